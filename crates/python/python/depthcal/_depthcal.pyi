"""The native module. Its users are the other files of this package; :class:`Corrector` and the exceptions are public."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Optional, Union, overload

import numpy as np
import numpy.typing as npt

__version__: str
has_detection: bool
"""Whether this package was built with detection of boards in images."""

Show = Optional[Callable[[str, int, str, int | None], None]]
Arguments = Mapping[str, Any]
"""Named arguments that belong together."""
Markers = Optional[tuple[Any, Any, Any]]
"""Numbers or None, positions (n, 2) in px, standard deviations in px or None."""
Depth = Union[npt.NDArray[np.uint16], npt.NDArray[np.float32]]
Amplitude = Union[npt.NDArray[np.uint16], npt.NDArray[np.uint8], None]
PerFrame = Union[float, Sequence[float], npt.NDArray[Any], None]
Counts = tuple[int, int, int, int]

class Error(Exception):
    """Why depthcal has no result; the class of all its exceptions."""

class InputError(Error):
    """Files, arrays or arguments are at fault: exit code 1 of the command line. The message names what, and the remedy."""

class UntrustedFitError(Error):
    """The fit cannot be trusted: exit code 2 of the command line."""

def set_threads(threads: int) -> None:
    """Sets the number of threads of all further calls, which RAYON_NUM_THREADS sets otherwise; all cores without either."""

def real_numbers(what: str, given: Any) -> npt.NDArray[np.float64]:
    """Real numbers of any type as an array of float64 in C order; :class:`InputError` names ``what`` where they are none."""

class Corrector:
    """Corrects the depth images of a calibrated camera.

    Built once, then used for every frame; may be used from several threads at a time, and in forked processes. Arrays in C order
    are read and written in place, without copies and without the GIL.
    """

    def __init__(self, calibration: Any, threads: int | None = None) -> None:
        """Prepares the correction for a :class:`Calibration`: rays of all pixels, and tables of its depth pieces.

        ``threads`` gives it so many threads of its own; otherwise it uses those that all correctors share. Raises
        :class:`InputError`.
        """

    @property
    def width(self) -> int:
        """Width of its images, px."""

    @property
    def height(self) -> int:
        """Height of its images, px."""

    @property
    def has_tables(self) -> bool:
        """Whether frames are corrected by tables; if not, every pixel is inverted, some hundred times slower."""

    @property
    def needs(self) -> list[str]:
        """Arguments that its effects need: some of ``time_s``, ``temperature_c``, ``amplitude``, and quantities of
        :meth:`with_quantities`. Without them these effects stay."""

    def with_quantities(self, quantities: dict[str, PerFrame]) -> Corrector:
        """This corrector for frames with these values of further quantities: keys are columns of frames.csv such as
        ``exposure_ms``, values one number, or one per frame of a call. Tables are shared. Raises :class:`InputError`."""

    @overload
    def correct(
        self,
        depth: npt.NDArray[np.uint16],
        unit_mm: float = 1.0,
        *,
        amplitude: Amplitude = None,
        time_s: PerFrame = None,
        temperature_c: PerFrame = None,
        out: npt.NDArray[np.uint16] | None = None,
    ) -> npt.NDArray[np.uint16]: ...
    @overload
    def correct(
        self,
        depth: npt.NDArray[np.float32],
        unit_mm: float = 1.0,
        *,
        amplitude: Amplitude = None,
        time_s: PerFrame = None,
        temperature_c: PerFrame = None,
        out: npt.NDArray[np.float32] | None = None,
    ) -> npt.NDArray[np.float32]:
        """Corrected depth, of the shape, type and unit of ``depth``: (height, width), or (frames, height, width).

        ``depth`` is in units of ``unit_mm`` millimetres, and so is the result: uint16 in whole steps, 0 and 65535 where nothing
        was measured, or float32, 0, NaN and infinity where nothing was; metres have ``unit_mm=1000``. What cannot be corrected
        is 0. ``amplitude`` is the infrared image, uint8 or uint16, of the shape of ``depth``; ``time_s`` (since the start of the
        recording) and ``temperature_c`` are numbers, or one per frame. Arrays may have any strides and byte order; those in C
        order are not copied. ``out`` receives the result: an array in C order of the type of the result, which may be ``depth``
        itself but must not overlap it otherwise. Raises :class:`InputError`; ``out`` is then unchanged, or holds the frames
        before the one at fault.
        """

    def correct_counting(
        self,
        depth: Depth,
        unit_mm: float = 1.0,
        *,
        amplitude: Amplitude = None,
        time_s: PerFrame = None,
        temperature_c: PerFrame = None,
        out: Depth | None = None,
    ) -> tuple[Depth, Counts]:
        """As :meth:`correct`, with numbers of pixels: corrected, of these beyond the range of the type, without depth, not correctable."""

    def correct_to_mm(
        self,
        depth: Depth,
        unit_mm: float = 1.0,
        *,
        amplitude: Amplitude = None,
        time_s: PerFrame = None,
        temperature_c: PerFrame = None,
        out: npt.NDArray[np.float32] | None = None,
    ) -> npt.NDArray[np.float32]:
        """As :meth:`correct`, in millimetres whatever the unit of ``depth``, not rounded to steps: float32 of the shape of
        ``depth``."""

    def points(
        self,
        depth: Depth,
        unit_mm: float = 1.0,
        *,
        amplitude: Amplitude = None,
        time_s: PerFrame = None,
        temperature_c: PerFrame = None,
        out: npt.NDArray[np.float32] | None = None,
    ) -> npt.NDArray[np.float32]:
        """Corrected points in the camera frame, in millimetres whatever the unit of ``depth``: float32 of shape (…, height,
        width, 3), NaN where there is no corrected depth.

        ``depth`` is as measured, in units of ``unit_mm`` millimetres, as :meth:`correct` takes it.
        """

    def uncertainty(
        self, depth: Depth, unit_mm: float = 1.0, *, out: npt.NDArray[np.float32] | None = None
    ) -> npt.NDArray[np.float32]:
        """Standard deviation of the corrected depth of every pixel in millimetres: float32 of the shape of ``depth``, NaN where
        there is no depth.

        ``depth`` is as measured, in units of ``unit_mm`` millimetres. The noise of the pixel and the uncertainty of the
        calibration's parameters are in it, under the conditions in the middle of those of the fit. Raises :class:`InputError` for
        a calibration without noise of depth.
        """

    def mask(self, corrected: Depth, unit_mm: float = 1.0) -> npt.NDArray[np.uint8]:
        """Where the calibration is supported, for corrected depth: uint8 of its shape, 255 where boards were seen there and at
        such depths, 128 where the calibration extrapolates, 0 without depth. Raises :class:`InputError` for a calibration without
        noise of depth.
        """

class Effect:
    name: str
    spec: str
    is_formula: bool
    equation: str
    latex: str
    parameters: list[tuple[str, str, float, float]]
    cost: tuple[int, int, float]
    @staticmethod
    def read(path: str) -> list[Effect]: ...
    @staticmethod
    def formula(definition: str) -> Effect: ...
    @staticmethod
    def function(
        name: str,
        function: Callable[[Sequence[float], Sequence[np.ndarray]], np.ndarray],
        covariates: Sequence[str],
        parameters: Sequence[tuple[str, str, float, float, str]],
        adds_to: str,
        of: str,
        summary: str,
        source: str,
    ) -> Effect: ...
    def toml(self) -> str: ...

class Dataset:
    name: str
    path: str
    digest: str
    size: tuple[int, int]
    unit_mm: float | None
    from_cache: bool
    board: str
    def cameras(self) -> list[str]: ...
    def camera(self, name: str) -> Dataset: ...
    def frames(self) -> list[tuple[str, int, bool, float, float, str]]: ...
    def dropped(self) -> list[tuple[str, str, str]]: ...
    def state(self) -> tuple[str, list[npt.NDArray[Any]]]: ...
    @staticmethod
    def of_state(text: str, arrays: Sequence[npt.NDArray[Any]]) -> Dataset: ...
    def markers(self, frame: str) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]: ...
    def image(self, frame: str) -> npt.NDArray[np.uint16] | None: ...
    def depth(self, frame: str) -> Depth | None: ...
    def write_observations(self, path: str) -> None: ...

class Calibration:
    size: tuple[int, int]
    @staticmethod
    def read(path: str, effects: Sequence[Effect], size: tuple[int, int] | None) -> Calibration: ...
    @staticmethod
    def known(
        size: tuple[int, int],
        pinhole: tuple[float, float, float, float, float],
        distortion: Sequence[float],
        is_fisheye: bool,
    ) -> Calibration: ...
    @staticmethod
    def parse(text: str, effects: Sequence[Effect]) -> Calibration: ...
    @staticmethod
    def formats() -> list[str]: ...
    def write(self, path: str) -> None: ...
    def json(self) -> str: ...
    def cameras(self) -> list[str]: ...
    def camera(self, name: str) -> Calibration: ...
    def export(self, format: str) -> tuple[str, list[str]]: ...
    def project(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]: ...
    def rays(self, pixels: npt.ArrayLike, depth_mm: float) -> npt.NDArray[np.float64]: ...

class Fit:
    def calibration(self) -> Calibration: ...
    def prior_sentences(self) -> list[str]: ...
    def scores(self, camera: str | None) -> str | None: ...
    def evaluation(self) -> str: ...
    def next_captures(
        self, goal: str, range_mm: tuple[float, float] | None, within: float | None, frames: int, camera: str | None
    ) -> str: ...
    def table(self) -> str: ...
    def report_html(self) -> str: ...
    def save(self, out: str) -> list[str]: ...

class Solved:
    def values(self, family: int) -> npt.NDArray[np.float64]: ...
    def report(self) -> tuple[str, str, str]: ...
    def covariance(self, variables: Sequence[tuple[int, int]]) -> npt.NDArray[np.float64]: ...
    def standard_deviations(self, family: int) -> npt.NDArray[np.float64]: ...

def solve(
    families: Sequence[tuple[str, str, npt.NDArray[np.float64]]],
    batches: Sequence[Arguments],
    fixed: Sequence[tuple[tuple[int, int], list[bool] | None]],
    bounds: Sequence[tuple[tuple[int, int], int, float, float]],
    options: Arguments,
) -> Solved: ...

class Registration:
    def __init__(self, calibration: Calibration, source: str, target: str) -> None: ...
    def register(
        self,
        depth: np.ndarray,
        unit_mm: float,
        image: np.ndarray | None,
        conditions: Arguments,
    ) -> tuple[np.ndarray, np.ndarray | None, int]: ...

class Fleet:
    def json(self) -> str: ...
    def prior(self) -> str: ...
    def text(self) -> str: ...
    def report_html(self) -> str: ...
    def save(self, out: str) -> list[str]: ...

class Evaluation:
    def json(self) -> str: ...
    def table(self) -> str: ...
    def dropped(self) -> list[tuple[str, str, str]]: ...
    def report_html(self) -> str: ...
    def save(self, out: str) -> list[str]: ...

class Comparison:
    def cameras(self) -> list[str]: ...
    def is_of_one(self) -> bool: ...
    def camera(self, name: str) -> Comparison: ...
    def json(self) -> str: ...
    def tables(self) -> list[tuple[str, str]]: ...
    def report_html(self) -> str: ...
    def save(self, out: str) -> list[str]: ...

class Diagnosis:
    def json(self) -> str: ...
    def cameras(self) -> list[str]: ...
    def camera(self, name: str) -> Diagnosis: ...
    def text(self) -> str: ...
    def sentence(self) -> str: ...
    def scores(self) -> str | None: ...
    def calibration(self) -> Calibration: ...
    def formulas(self) -> list[Effect]: ...
    def evaluation(self) -> str: ...
    def report_html(self) -> str: ...
    def save(self, out: str) -> list[str]: ...

class Difference:
    def json(self) -> str: ...
    def sentences(self) -> list[str]: ...
    def text(self) -> str: ...
    def report_html(self) -> str: ...
    def save(self, out: str) -> list[str]: ...

def load(
    path: str,
    markers: Sequence[tuple[str, Markers]] | None,
    cache: bool,
    refresh: bool,
    image_memory_mib: int,
    progress: Show,
) -> Dataset: ...
def from_memory(
    name: str,
    board: str,
    camera: Arguments,
    frames: Sequence[tuple[Any, ...]],
) -> Dataset: ...
def from_cameras(name: str, cameras: Sequence[tuple[str, Dataset, Sequence[float] | None]]) -> Dataset: ...
def write_board(board: str, out: str, paper: str | None) -> tuple[tuple[float, float], float, str, tuple[str, str]]: ...
def write_files(out: str, main: str, files: Sequence[tuple[str, bytes]]) -> list[Any]: ...
def import_recording(recording: str, out: str, options: Arguments, progress: Show) -> str: ...
def calibrate(
    dataset: Dataset,
    model: Arguments,
    options: Arguments,
    call: str,
    progress: Show,
) -> Fit: ...
def evaluate(
    calibration: Calibration,
    datasets: Sequence[Dataset],
    with_: Sequence[str],
    title: str,
    call: str,
    progress: Show,
    /,
) -> Evaluation: ...
def compare(
    train: Dataset,
    verify: Sequence[Dataset],
    model: Arguments,
    options: Arguments,
    call: str,
    progress: Show,
) -> Comparison: ...
def diagnose(
    dataset: Dataset,
    verify: Dataset | None,
    model: Arguments,
    options: Arguments,
    call: str,
    progress: Show,
) -> Diagnosis: ...
def diff(
    first: Calibration | str,
    second: Calibration | str,
    names: Sequence[str],
    size: tuple[int, int] | None,
    call: str,
    progress: Show,
) -> Difference: ...
def fleet(
    calibrations: Sequence[str],
    in_memory: Sequence[tuple[str, str, str | None]],
    level: float,
    effects: Sequence[Effect],
    call: str,
    progress: Show,
) -> Fleet: ...
def simulate(out: str, given: Arguments, truth: str | None) -> int: ...
def simulate_points(given: Arguments, samples: int) -> Dataset: ...

"""Every function that takes an array: of any strides and byte order it gives what it gives for the array in C order, to the
byte; what it cannot take is refused by name."""

import numpy as np
import pytest
from conftest import SMALL, small_wave

import depthcal


def fields(a):
    """A field of records with a byte before it: neither contiguous nor aligned."""
    records = np.zeros(a.shape, np.dtype([("before", np.uint8), ("value", a.dtype)]))
    records["value"] = a
    return records["value"]


def strided(a):
    wide = np.full([2 * n for n in a.shape], 77, a.dtype)
    view = wide[tuple(slice(None, None, 2) for _ in a.shape)]
    view[...] = a
    return view


def cropped(a):
    wide = np.full([n + 3 for n in a.shape], 77, a.dtype)
    view = wide[tuple(slice(1, n + 1) for n in a.shape)]
    view[...] = a
    return view


def everywhere_reversed(a):
    backwards = tuple(slice(None, None, -1) for _ in a.shape)
    return np.ascontiguousarray(a[backwards])[backwards]


def read_only(a):
    a = a.copy()
    a.flags.writeable = False
    return a


def unaligned(a):
    return np.frombuffer(b"\1" + a.tobytes(), a.dtype, offset=1).reshape(a.shape)


LAYOUTS = {
    # As scipy.io.loadmat returns arrays.
    "fortran": np.asfortranarray,
    "transposed": lambda a: np.ascontiguousarray(a.T).T,
    "strided": strided,
    "cropped": cropped,
    "reversed": everywhere_reversed,
    "read-only": read_only,
    "big-endian": lambda a: a.astype(a.dtype.newbyteorder(">")),
    "big-endian fortran": lambda a: np.asfortranarray(a.astype(a.dtype.newbyteorder(">"))),
    "of records": fields,
    "unaligned": unaligned,
}
layouts = pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS.keys())

#: Arrays of no type that an image may have, and what the error says of them.
WRONG_TYPES = {
    "float64": lambda a: a.astype(np.float64),
    "int16": lambda a: a.astype(np.int16),
    "int32": lambda a: a.astype(np.int32),
    "bool": lambda a: a > 0,
    "complex64": lambda a: a.astype(np.complex64),
    "object": lambda a: a.astype(object),
    "list": lambda a: a.tolist(),
    "masked": lambda a: np.ma.masked_equal(a, 0),
}
wrong_types = pytest.mark.parametrize(("words", "make"), WRONG_TYPES.items(), ids=WRONG_TYPES.keys())

#: What is no real numbers.
NO_NUMBERS = {
    "complex128": lambda a: a + 0j,
    "bool": lambda a: a > 0,
    "object": lambda a: a.astype(object),
    "<U": lambda a: a.astype(str),
    "masked": lambda a: np.ma.masked_less(a, 0.5),
}
no_numbers = pytest.mark.parametrize(("words", "make"), NO_NUMBERS.items(), ids=NO_NUMBERS.keys())


def same_bytes(given, expected):
    assert given.dtype == expected.dtype and given.shape == expected.shape
    assert given.tobytes() == expected.tobytes()


@pytest.fixture(scope="module")
def corrector(small):
    return depthcal.Corrector(small)


@pytest.fixture(scope="module")
def registration(small_rig):
    return depthcal.Registration(small_rig, "infrared", "colour")


METHODS = ["correct", "correct_counting", "correct_to_mm", "points"]


def result(corrector, method, *arguments, **named):
    given = getattr(corrector, method)(*arguments, **named)
    return given[0] if method == "correct_counting" else given


@layouts
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_depth_of_any_layout_is_corrected_alike(corrector, layout, method, dtype):
    depth = small_wave().astype(dtype)
    expected = result(corrector, method, depth)
    assert (expected.reshape(-1)[: depth.size] != depth.reshape(-1)).any()
    given = layout(depth)
    np.testing.assert_array_equal(given, depth)
    same_bytes(result(corrector, method, given), expected)
    out = np.empty_like(expected)
    assert result(corrector, method, given, out=out) is out
    same_bytes(out, expected)
    np.testing.assert_array_equal(given, depth)


@layouts
@pytest.mark.parametrize("method", METHODS)
def test_stacks_of_any_layout_are_corrected_alike(corrector, layout, method):
    depth = np.stack([small_wave(seed) for seed in range(3)])
    expected = np.stack([result(corrector, method, frame) for frame in depth])
    same_bytes(result(corrector, method, layout(depth)), expected)


@layouts
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_what_comes_with_depth_may_have_any_layout(layout, dtype):
    points = depthcal.simulate_points(
        frames=20, samples=60, effects=["reflectivity_bias=6", "temporal_drift=6"], seed=2
    )
    fit = depthcal.calibrate(points, effects=["reflectivity_bias", "temporal_drift"])
    corrector = depthcal.Corrector(fit.calibration)
    depth = np.full((2, 480, 640), 1500, np.uint16)
    amplitude = np.random.default_rng(1).integers(30, 250, depth.shape).astype(dtype)
    times = np.array([0.0, 500.0])
    expected = corrector.correct_to_mm(depth, amplitude=amplitude, time_s=times)
    assert (expected[0] != expected[1]).any()
    same_bytes(corrector.correct_to_mm(depth, amplitude=layout(amplitude), time_s=layout(times)), expected)
    same_bytes(corrector.correct_to_mm(depth, amplitude=amplitude, time_s=times.astype(np.int32)), expected)


def test_an_array_that_maps_a_file_is_read(corrector, tmp_path):
    np.save(tmp_path / "depth.npy", np.asfortranarray(small_wave()))
    same_bytes(
        corrector.correct(np.load(tmp_path / "depth.npy", mmap_mode="r")),
        corrector.correct(np.load(tmp_path / "depth.npy").copy(order="C")),
    )


@wrong_types
@pytest.mark.parametrize("method", METHODS)
def test_depth_of_another_type_is_refused(corrector, words, make, method):
    with pytest.raises(depthcal.InputError, match=f"^depth .*{words}"):
        result(corrector, method, make(small_wave()))
    with pytest.raises(depthcal.InputError, match=f"^amplitude .*{words}"):
        result(corrector, method, small_wave(), amplitude=make(small_wave()))


@no_numbers
def test_numbers_of_frames_are_refused_by_name(corrector, words, make):
    for name in ("time_s", "temperature_c"):
        with pytest.raises(depthcal.InputError, match=f"^{name} .*{words}"):
            corrector.correct(np.stack([small_wave()] * 2), **{name: make(np.array([1.0, 0.0]))})
        for wrong in (np.zeros((2, 1)), np.zeros(1), np.zeros(3), np.zeros(0)):
            with pytest.raises(depthcal.InputError, match=f"^{name} has the shape .* one per frame"):
                corrector.correct(np.stack([small_wave()] * 2), **{name: wrong})


@pytest.mark.parametrize("method", METHODS)
def test_empty_arrays(corrector, method):
    nothing = result(corrector, method, np.empty((0, *SMALL), np.uint16))
    assert nothing.size == 0 and nothing.shape[:3] == (0, *SMALL)
    for shape in [(0,), (), (0, 0), (0, SMALL[1]), (SMALL[0], 0), (1, 0, *SMALL)]:
        with pytest.raises(depthcal.InputError, match="^depth has the shape"):
            result(corrector, method, np.empty(shape, np.uint16))
        with pytest.raises(depthcal.InputError, match="^amplitude has the shape"):
            result(corrector, method, small_wave(), amplitude=np.empty(shape, np.uint8))


def out_of(method, dtype):
    shape = (*SMALL, 3) if method == "points" else SMALL
    return np.zeros(shape, dtype if method in ("correct", "correct_counting") else np.float32)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_results_are_written_in_place_or_not_at_all(corrector, method, dtype):
    depth, right = small_wave().astype(dtype), out_of(method, dtype)
    other = np.int16 if right.dtype == np.uint16 else np.float64
    refused = [
        (np.asfortranarray(right), "C order"),
        (everywhere_reversed(right), "C order"),
        (strided(right), "C order"),
        (fields(right), "C order"),
        (unaligned(right), "C order"),
        (read_only(right), "writeable"),
        (right.astype(right.dtype.newbyteorder(">")), ">"),
        (right.astype(other), np.dtype(other).name),
        (right[None], "shape"),
        (right[:-1].copy(), "shape"),
        (np.empty(0, right.dtype), "shape"),
        (right.tolist(), "list"),
        (np.ma.masked_array(right), "masked"),
        ("result", "str"),
    ]
    for out, words in refused:
        before = out.copy() if isinstance(out, np.ndarray) else None
        with pytest.raises(depthcal.InputError, match=f"^out .*{words}"):
            result(corrector, method, depth, out=out)
        if before is not None:
            np.testing.assert_array_equal(out, before)
    assert result(corrector, method, depth, out=right) is right


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_depth_may_be_replaced_by_its_result(corrector, dtype):
    expected = corrector.correct(small_wave().astype(dtype))
    for view in (
        lambda a: a,
        lambda a: a[:],
        lambda a: a.reshape(-1).reshape(SMALL),
        lambda a: np.frombuffer(a.data, dtype).reshape(SMALL),
    ):
        depth = small_wave().astype(dtype)
        corrector.correct(depth, out=view(depth))
        same_bytes(depth, expected)
    stack = np.stack([small_wave(1), small_wave(2)]).astype(dtype)
    expected = corrector.correct(stack.copy())
    same_bytes(corrector.correct(stack, out=stack), expected)


def test_memory_that_is_read_and_written_is_refused(corrector):
    memory = np.zeros(SMALL[0] * SMALL[1] * 4 + 64, np.uint8)
    n = SMALL[0] * SMALL[1]

    def view(first, dtype, shape=SMALL):
        # Each by a buffer of its own, so that numpy does not know of a common base.
        size = int(np.prod(shape)) * np.dtype(dtype).itemsize
        return np.frombuffer(memoryview(memory)[first : first + size], dtype).reshape(shape)

    depth = view(0, np.uint16)
    depth[...] = small_wave()
    square = np.zeros((2, *SMALL), np.uint16)
    for call, what in [
        (lambda: corrector.correct(depth, out=view(2, np.uint16)), "depth"),
        (lambda: corrector.correct(depth, out=view(2 * SMALL[1], np.uint16)), "depth"),
        (lambda: corrector.correct_to_mm(depth, out=view(0, np.float32)), "depth"),
        (lambda: corrector.correct(np.ones(SMALL, np.uint16), amplitude=depth, out=depth), "amplitude"),
        (lambda: corrector.correct(np.ones(SMALL, np.uint16), amplitude=view(9, np.uint8), out=depth), "amplitude"),
        (lambda: corrector.correct(square[::-1], out=square), "depth"),
    ]:
        with pytest.raises(depthcal.InputError, match=f"^out overlaps {what}"):
            call()
    large = np.zeros((*SMALL, 3), np.float32)
    with pytest.raises(depthcal.InputError, match="^out overlaps depth"):
        corrector.points(large.reshape(3, *SMALL)[1], out=large)
    np.testing.assert_array_equal(depth, small_wave())
    # Parts of one buffer that do not overlap are no mistake.
    corrector.correct(depth, out=view(2 * n, np.uint16))
    same_bytes(view(2 * n, np.uint16), corrector.correct(small_wave()))


@layouts
@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_registration_of_any_layout(registration, layout, dtype):
    depth = np.full(SMALL, 900, dtype)
    depth[::3] += 400
    colours = np.random.default_rng(2).integers(1, 255, (*SMALL, 3), dtype=np.uint8)
    amplitude = np.random.default_rng(3).integers(1, 255, SMALL, dtype=np.uint8)
    expected = registration(depth, image=colours, amplitude=amplitude)
    assert (expected.depth > 0).any() and expected.depth.dtype == dtype and expected.colours.any()
    given = registration(layout(depth), image=layout(colours), amplitude=layout(amplitude))
    same_bytes(given.depth, expected.depth)
    same_bytes(given.colours, expected.colours)
    assert given.holes == expected.holes


@wrong_types
def test_registration_refuses_other_types(registration, words, make):
    depth = small_wave()
    with pytest.raises(depthcal.InputError, match=f"^depth .*{words}"):
        registration(make(depth))
    with pytest.raises(depthcal.InputError, match=f"^amplitude .*{words}"):
        registration(depth, amplitude=make(depth))
    with pytest.raises(depthcal.InputError, match=f"^image .*{words}"):
        registration(depth, image=make(np.ones((*SMALL, 3), np.uint8)))
    for name, shape in [("depth", (0,)), ("amplitude", (0, 3)), ("image", (*SMALL, 4)), ("image", (0, 0, 3))]:
        array = np.zeros(shape, np.uint8 if name == "image" else np.uint16)
        with pytest.raises(depthcal.InputError, match=f"^{name} has the shape"):
            registration(**{"depth": depth, name: array})


@layouts
@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int32])
def test_points_and_pixels_of_any_layout(small, layout, dtype):
    points = np.random.default_rng(4).integers(-300, 900, (40, 3)).astype(dtype)
    same_bytes(small.project(layout(points)), small.project(points.astype(np.float64)))
    pixels = np.random.default_rng(5).integers(0, 60, (40, 2)).astype(dtype)
    same_bytes(small.rays(layout(pixels)), small.rays(pixels.astype(np.float64)))
    same_bytes(small.project(points.tolist()), small.project(points))


@no_numbers
def test_points_and_pixels_are_refused_by_name(small, words, make):
    with pytest.raises(depthcal.InputError, match=f"^points .*{words}"):
        small.project(make(np.ones((4, 3))))
    with pytest.raises(depthcal.InputError, match=f"^pixels .*{words}"):
        small.rays(make(np.ones((4, 2))))
    assert small.project(np.empty((0, 3))).shape == small.rays(np.empty((0, 2))).shape == (0, 2)
    for shape in [(0,), (3,), (4, 4), (1, 4, 3)]:
        with pytest.raises(depthcal.InputError, match="^points have the shape"):
            small.project(np.ones(shape))
        with pytest.raises(depthcal.InputError, match="^pixels have the shape"):
            small.rays(np.ones(shape))


BOARD = depthcal.Board.chessboard(4, 3, 20.0)
IDS = np.array([0, 2, 3, 7, 11])


def seen(ids, columns, spacing, seed):
    """Where markers of a board that is seen from its front may be."""
    random = np.random.default_rng(seed)
    return 5 + spacing * np.stack([ids % columns, ids // columns], axis=1) + random.uniform(-1, 1, (len(ids), 2))


PIXELS = seen(IDS, 4, 12, 6)
STDS = np.array([0.1, 0.2, 0.1, 0.3, 0.1])


def frame(ids=IDS, pixels=PIXELS, stds=STDS, depth=None, image=None):
    depth = small_wave() if depth is None else depth
    image = small_wave(8) if image is None else image
    return depthcal.Frame((ids, pixels, stds), depth, image, "f")


def dataset(*frames, **named):
    return depthcal.Dataset.from_arrays(BOARD, frames, unit_mm=1.0, **named)


@layouts
@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
@pytest.mark.parametrize("gray", [np.uint8, np.uint16])
def test_datasets_of_any_layout(layout, dtype, gray):
    depth, image = small_wave().astype(dtype), small_wave(8).astype(gray)
    intrinsics = np.array([[500.0, 0.5, 30], [0, 510.0, 20], [0, 0, 1]])
    expected = dataset(frame(depth=depth, image=image), intrinsics=intrinsics, distortion=np.arange(5.0))
    given = dataset(
        frame(layout(IDS), layout(PIXELS), layout(STDS), layout(depth), layout(image)),
        intrinsics=layout(intrinsics),
        distortion=layout(np.arange(5.0)),
    )
    # The digest is of all contents, standard deviations included.
    assert given.digest == expected.digest
    same_bytes(given.depth("f"), depth)
    same_bytes(given.image("f"), image.astype(np.uint16))
    for marker, same in zip(given.markers("f"), (IDS, PIXELS)):
        same_bytes(marker, same)


def test_markers_as_other_programs_have_them():
    expected = dataset(frame())
    for ids, pixels, stds in [
        (IDS.astype(np.int32)[:, None], PIXELS[:, None, :], STDS),
        (IDS.astype(np.float64)[None], PIXELS, STDS[:, None]),
        (IDS.tolist(), PIXELS.tolist(), STDS.tolist()),
        (IDS.astype(np.uint64), PIXELS, STDS),
    ]:
        assert dataset(frame(ids, pixels, stds)).digest == expected.digest
    everything = seen(np.arange(12), 4, 12, 7)[:, None].astype(np.float32)
    given = depthcal.Dataset.from_arrays(BOARD, [depthcal.Frame(everything)], size=SMALL[::-1])
    np.testing.assert_array_equal(given.markers("0000")[0], np.arange(12))
    np.testing.assert_array_equal(given.markers("0000")[1], everything[:, 0].astype(np.float64))


@layouts
def test_corners_of_another_program_of_any_layout(layout, tmp_path):
    folder = depthcal.simulate(tmp_path / "c", board="chessboard", frames=1, seed=1)
    name = sorted((folder / "image").iterdir())[0].stem
    ids, pixels = np.arange(20), seen(np.arange(20), 9, 40, 8)
    given = depthcal.load(folder, corners={name: (layout(ids), layout(pixels))})
    same_bytes(given.markers(name)[0], ids)
    same_bytes(given.markers(name)[1], pixels)


@wrong_types
def test_datasets_refuse_images_of_other_types(words, make):
    with pytest.raises(depthcal.InputError, match=f"'f'.*depth.* {words}|'f'.*depth.*{words} array"):
        dataset(frame(depth=make(small_wave())), size=SMALL[::-1])
    with pytest.raises(depthcal.InputError, match=f"'f'.*image.* {words}|'f'.*image.*{words} array"):
        dataset(frame(image=make(small_wave())), size=SMALL[::-1])
    with pytest.raises(depthcal.InputError, match="'f'.*depth image.*shape"):
        dataset(frame(depth=np.empty((0, 4), np.uint16)), size=SMALL[::-1])
    with pytest.raises(depthcal.InputError, match="'f'.*the image.*shape"):
        dataset(frame(image=np.empty((48, 64, 3), np.uint8)), size=SMALL[::-1])


@no_numbers
def test_datasets_refuse_what_is_no_number(words, make):
    for name, given in [
        ("markers", dict(pixels=make(PIXELS))),
        ("numbers of markers", dict(ids=make(IDS.astype(np.float64)))),
        ("standard deviations", dict(stds=make(STDS))),
    ]:
        with pytest.raises(depthcal.InputError, match=f"'f': {name}.*{words}"):
            dataset(frame(**given))
    with pytest.raises(depthcal.InputError, match=f"^intrinsics.*{words}"):
        dataset(frame(), intrinsics=make(np.eye(3)))
    with pytest.raises(depthcal.InputError, match=f"^distortion.*{words}"):
        dataset(frame(), intrinsics=np.eye(3), distortion=make(np.arange(5.0)))


def test_markers_are_refused_by_name():
    for given, words in [
        (dict(ids=IDS + 0.5), "numbers of markers has 0.5: give whole numbers"),
        (dict(ids=np.array([0, 1, 2, 3, np.nan])), "whole numbers"),
        (dict(ids=IDS[:-1]), "one row"),
        (dict(ids=-IDS), "begin at 0"),
        (dict(stds=STDS[:-1]), "one per marker"),
        (dict(pixels=PIXELS.T), "shape .2, 5."),
        (dict(pixels=np.ones(10)), "shape .10."),
    ]:
        with pytest.raises(depthcal.InputError, match=f"'f'.*{words}"):
            dataset(frame(**given))
    with pytest.raises(depthcal.InputError, match="'f'.*4 parts"):
        dataset(depthcal.Frame((IDS, PIXELS, STDS, STDS), small_wave(), name="f"))
    # A frame without markers has no board.
    empty = depthcal.Frame((np.empty(0, np.int64), np.empty((0, 2))), small_wave(), name="empty")
    assert [row.name for row in dataset(frame(), empty).dropped] == ["empty"]


@layouts
def test_functions_may_give_any_layout(points, layout):
    def made(give):
        @depthcal.effect(parameters={"a": "mm", "b": "mm"}, name="bend")
        def bend(x, y, z, a, b):
            return give((a * x + b * y * y) * z / 1000)

        return depthcal.calibrate(points, effects=[bend]).calibration

    assert list(made(layout).parameters) == list(made(lambda values: values).parameters)


@no_numbers
def test_functions_that_give_no_numbers_are_refused(words, make):
    with pytest.raises(depthcal.InputError, match=f"'f'.*{words}"):
        depthcal.effect(parameters={"a": ("mm", 1.0)}, name="f")(lambda z, a: make(a * z))

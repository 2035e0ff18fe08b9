"""One camera or several through the same functions; what travels, what is held, what is named."""

import multiprocessing
import os
import pickle
import sqlite3
import struct
import subprocess
import sys

import numpy as np
import pytest
from conftest import BOARD, wave

import depthcal


def arrays_of(dataset):
    """The arguments of a dataset of arrays: its board and its frames."""
    frames = []
    for row in dataset.frames:
        image = dataset.image(row.name)
        frames.append(
            depthcal.Frame(
                dataset.markers(row.name),
                dataset.depth(row.name),
                None if image is None else image.astype(np.uint8),
                row.name,
                timestamp_s=row.time_s,
            )
        )
    return dataset.board, frames


@pytest.fixture(scope="module")
def cameras(images, corners, dataset):
    """The same captures as those of two cameras: infrared with depth, and a colour camera in its place without."""
    grey = [depthcal.Frame(corners[name], None, gray, name) for name, (gray, _) in images.items()]
    frames = [depthcal.Frame(corners[name], depth, gray, name) for name, (gray, depth) in images.items()]
    return {
        "infrared": depthcal.Dataset.from_arrays(BOARD, frames, unit_mm=dataset.unit_mm),
        "colour": depthcal.Dataset.from_arrays(BOARD, grey),
    }


@pytest.fixture(scope="module")
def rig(cameras):
    return depthcal.Dataset.from_cameras(cameras, name="both")


@pytest.fixture(scope="module")
def rig_fit(rig):
    return depthcal.calibrate(rig, hold_out=4)


def test_a_rig_of_arrays(rig, rig_fit, cameras):
    assert rig.cameras == ["infrared", "colour"] and rig.name == "both"
    assert len(rig.camera("colour")) == len(cameras["colour"])
    # Both are one camera in one place: no turn and no shift beyond the noise of corners of some hundredths of a pixel.
    matrix = rig_fit.calibration.transform("infrared", "colour")
    assert np.abs(matrix[:3, :3] - np.eye(3)).max() < 1e-3 and np.abs(matrix[:3, 3]).max() < 2.0
    row = rig_fit.calibration.extrinsics["colour"]
    shift = [row.tx_mm, row.ty_mm, row.tz_mm]
    stds = [row.tx_std_mm, row.ty_std_mm, row.tz_std_mm]
    assert all(std > 0 for std in stds) and np.allclose(matrix[:3, 3], shift)
    assert rig_fit.calibration.extrinsics["infrared"].tx_std_mm is None
    back = rig_fit.calibration.transform("colour", "infrared")
    np.testing.assert_allclose(back @ matrix, np.eye(4), atol=1e-12)
    evaluation = depthcal.evaluate(rig_fit, rig)
    assert len(evaluation.datasets) == 2 and evaluation.transfers[0].rms_px < 2


def test_known_extrinsics_are_kept(cameras):
    known = np.eye(4)
    known[0, 3] = 0.01
    rig = depthcal.Dataset.from_cameras(cameras, extrinsics={"colour": known})
    fit = depthcal.calibrate(rig)
    np.testing.assert_allclose(fit.calibration.transform("infrared", "colour"), known, atol=1e-12)
    turned = np.array([[0, 0, 1.0, 5], [1, 0, 0, 6], [0, 1, 0, 7]])
    rows = depthcal.Dataset.from_cameras(cameras, extrinsics={"colour": turned})
    assert rows.cameras == ["infrared", "colour"]


def test_what_is_no_rig_is_refused(cameras, points):
    for given, words in [
        ({"infrared": cameras["infrared"]}, "at least two"),
        ({**cameras, "other": points}, "one board"),
        ({**cameras, "a/b": cameras["colour"]}, "a/b"),
        ({**cameras, "path": "captures"}, "'path' is a str"),
    ]:
        with pytest.raises(depthcal.InputError, match=words):
            depthcal.Dataset.from_cameras(given)
    for extrinsics, words in [
        ({"thermal": np.eye(4)}, "thermal"),
        ({"colour": np.eye(3)}, "shape"),
        ({"colour": 2 * np.eye(4)}, "no rotation"),
    ]:
        with pytest.raises(depthcal.InputError, match=words):
            depthcal.Dataset.from_cameras(cameras, extrinsics=extrinsics)


def test_figures_of_rigs(rig, rig_fit):
    plt = pytest.importorskip("matplotlib.pyplot")
    for plot in (rig.plot, rig_fit.plot, depthcal.evaluate(rig_fit, rig).plot):
        axes = plot()
        assert len(axes) == 2 and all(ax.has_data() for ax in axes)
        given = plt.subplots(1, 2)[1]
        assert list(plot(ax=given)) == list(given)
        with pytest.raises(depthcal.InputError, match="2, one for each"):
            plot(ax=given[0])
        plt.close("all")
    assert rig_fit.calibration.plot().has_data() and rig_fit.calibration.plot_extrinsics().has_data()
    plt.close("all")
    with pytest.raises(depthcal.InputError, match="one camera"):
        rig_fit.calibration.camera("colour").plot_extrinsics()


def test_a_camera_of_a_rig_keeps_its_uncertainty(rig_fit, images):
    depth = next(iter(images.values()))[1]
    unit = rig_fit.calibration.record["cameras"][0]["depth_unit_mm"]
    whole = depthcal.Corrector(rig_fit.calibration)
    alone = depthcal.Corrector(rig_fit.calibration.camera("infrared"))
    expected = whole.uncertainty(depth, unit)
    assert np.nanmedian(expected) > 0
    np.testing.assert_array_equal(alone.uncertainty(depth, unit), expected)
    np.testing.assert_array_equal(alone.mask(depth, unit), whole.mask(depth, unit))
    # The covariance is part of it: noise alone gives less.
    record = {**rig_fit.calibration.camera("infrared").record, "covariance": None}
    from conftest import parsed

    assert (depthcal.Corrector(parsed(record)).uncertainty(depth, unit) < expected)[depth > 0].mean() > 0.99
    covariance = rig_fit.calibration.camera("colour").covariance
    in_rig = rig_fit.calibration.covariance
    assert covariance.names == [
        n.removeprefix("colour/")
        for n in in_rig.names
        if n.startswith("colour/pinhole") or n.startswith("colour/brown")
    ]
    assert covariance["pinhole.fx", "pinhole.cx"] == in_rig["colour/pinhole.fx", "colour/pinhole.cx"]
    poses = rig_fit.calibration.camera("infrared").poses
    assert poses[0] == rig_fit.calibration.poses[0]


def test_depth_models_are_compared_on_a_rig(rig, tmp_path):
    comparison = depthcal.compare(rig, models=["none", "projective"], folds=3)
    assert list(comparison.cameras) == ["infrared"]
    infrared = comparison.cameras["infrared"]
    assert infrared.models.names[0] == "projective" and "projective" in repr(comparison)
    with pytest.raises(depthcal.InputError, match="several cameras: take one of infrared"):
        comparison.models  # noqa: B018
    comparison.save(tmp_path)
    assert (tmp_path / "infrared" / "comparison.json").is_file()
    assert "<html" in infrared.report.html


# --- Names --------------------------------------------------------------------------------------------------------------------------


def test_tables_and_matrices_by_name(fit):
    parameters = fit.calibration.parameters
    place = parameters.names.index("pinhole.fx")
    assert parameters["pinhole.fx"] is parameters[place]
    assert parameters.column("value")[place] == fit.calibration.value("pinhole.fx") == fit.calibration.matrix[0, 0]
    covariance = fit.calibration.covariance
    assert covariance.shape == (len(covariance), len(covariance.names))
    assert np.isclose(np.sqrt(covariance["pinhole.fx", "pinhole.fx"]), parameters["pinhole.fx"].std_dev, rtol=1e-6)
    some = covariance[["pinhole.fy", "pinhole.fx"]]
    assert (
        some.names == ["pinhole.fy", "pinhole.fx"]
        and some["pinhole.fx", "pinhole.fy"] == covariance["pinhole.fy", "pinhole.fx"]
    )
    np.testing.assert_array_equal(np.asarray(some), np.asarray(some).T)
    for wrong in (
        lambda: parameters["pinhole.f"],
        lambda: covariance["pinhole.fx", "f"],
        lambda: parameters.column("v"),
    ):
        with pytest.raises(KeyError, match="there are"):
            wrong()
    assert fit.errors[fit.errors.names[0]] is not None and fit.frames.names == []


def test_parameters_of_a_rig_have_their_cameras_names(rig_fit):
    parameters = rig_fit.calibration.parameters
    assert {"infrared/pinhole.fx", "colour/pinhole.fx"} <= set(parameters.names)
    free = [row for row in parameters if row.std_dev is not None]
    covariance = rig_fit.calibration.covariance
    for row in free:
        assert np.isclose(row.std_dev, np.sqrt(covariance[row.name, row.name]), rtol=1e-6)


def test_without_pandas(points):
    program = (
        "import sys; sys.modules['pandas'] = None; import depthcal; "
        "fit = depthcal.calibrate(depthcal.simulate_points(frames=10, samples=60)); c = fit.calibration; "
        "print(c.covariance['pinhole.fx', 'pinhole.fy'] != 0, c.correlation['pinhole.fx', 'pinhole.fx'], "
        "len(repr(c.covariance)) > 100, len(c.parameters.names))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=os.environ)
    assert done.stdout.split()[0] == "True" and abs(float(done.stdout.split()[1]) - 1) < 1e-9, done.stderr


# --- Held parameters ----------------------------------------------------------------------------------------------------------------


def test_parameters_are_held_in_a_call(points):
    free = depthcal.calibrate(points).calibration
    assert not free.parameters["brown_conrady.k3"].fixed
    held = depthcal.calibrate(points, fixed=["brown_conrady.k3", "projective.dz"]).calibration
    assert held.parameters["brown_conrady.k3"].fixed and held.value("brown_conrady.k3") == 0.0
    assert held.value("projective.dz") == 0.0 and held.parameters["projective.dz"].fixed
    assert list(held.parameters) == list(
        depthcal.calibrate(points, effects=["fixed:brown_conrady.k3", "fixed:projective.dz"]).calibration.parameters
    )
    at = {"pinhole.fx": free.value("pinhole.fx") + 1.0, "brown_conrady.k1": 0.01, "brown_conrady.k3": None}
    fit = depthcal.calibrate(points, fixed=at)
    for name, value in at.items():
        row = fit.calibration.parameters[name]
        assert row.fixed and row.std_dev is None and row.value == (value or 0.0), row
    assert fit.errors[0].reprojection_px > 0
    for wrong, words in [
        (["pinhole.f"], "pinhole.f"),
        ({"k3": 1.0}, "PIECE.PARAMETER"),
        (["pinhole.fx"], "no value"),
        ({"pinhole.cx": np.inf}, "inf"),
    ]:
        with pytest.raises(depthcal.InputError, match=words):
            depthcal.calibrate(points, fixed=wrong)


def test_the_command_line_holds_parameters_at_values(cli, folder, dataset, tmp_path):
    cli("calibrate", folder, "--with", "fixed:brown_conrady.k1=0.02", "--out", tmp_path / "cli")
    depthcal.calibrate(depthcal.load(folder), fixed={"brown_conrady.k1": 0.02}).save(tmp_path / "python")
    name = "calibration.json"
    assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "cli" / name).read_bytes()


# --- Known cameras ------------------------------------------------------------------------------------------------------------------


def test_a_camera_of_known_numbers():
    k = np.array([[600.0, 0, 321], [0, 602, 239], [0, 0, 1]])
    d = np.array([-0.1, 0.02, 1e-3, -2e-3, 0.005])
    camera = depthcal.Calibration.from_intrinsics(k, d, size=(640, 480))
    np.testing.assert_array_equal(camera.matrix, k)
    points = np.random.default_rng(1).uniform([-0.4, -0.3, 1], [0.4, 0.3, 2], (50, 3)) * 1000
    # OpenCV's equations, written out.
    x, y = (points[:, :2] / points[:, 2:]).T
    r2 = x * x + y * y
    radial = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))
    xd = x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x)
    yd = y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y
    expected = np.stack([600 * xd + 321, 602 * yd + 239], axis=1)
    np.testing.assert_allclose(camera.project(points), expected, atol=1e-9)
    np.testing.assert_allclose(camera.rays(expected), np.stack([x, y], axis=1), atol=1e-7)
    assert camera.covariance is None and "640×480" in repr(camera) and len(camera.poses) == 0
    again = pickle.loads(pickle.dumps(camera))
    np.testing.assert_array_equal(again.project(points), camera.project(points))
    # Depth stays, points are on the rays.
    depth = np.full((480, 640), 1000, np.uint16)
    np.testing.assert_array_equal(depthcal.Corrector(camera).correct(depth), depth)
    for wrong, words in [
        (dict(matrix=[600, 600, 320], size=(640, 480)), "fx, fy"),
        (dict(matrix=k, distortion=[1, 2, 3], size=(640, 480)), "3 coefficients"),
        (dict(matrix=k, distortion=[0.1] * 5, size=(640, 480), fisheye=True), "4, k1 to k4"),
        (dict(matrix=k, size=(0, 480)), "size is 0"),
        (dict(matrix=-k, size=(640, 480)), "focal"),
    ]:
        with pytest.raises(depthcal.InputError, match=words):
            depthcal.Calibration.from_intrinsics(**wrong)


def test_fisheye_of_known_numbers_is_opencv_s():
    cv2 = pytest.importorskip("cv2", reason="SKIPPED: a fisheye camera; OpenCV is not installed")
    k, d = np.array([[300.0, 0, 320], [0, 301, 240], [0, 0, 1]]), np.array([0.05, -0.01, 0.003, -0.001])
    camera = depthcal.Calibration.from_intrinsics(k, d, size=(640, 480), fisheye=True)
    points = np.random.default_rng(2).uniform([-1, -1, 0.8], [1, 1, 2], (40, 3))
    expected = cv2.fisheye.projectPoints(points[None], np.zeros(3), np.zeros(3), k, d)[0][0]
    np.testing.assert_allclose(camera.project(points), expected, atol=1e-6)


def test_camera_files_of_other_programs_are_calibrations(fit, tmp_path):
    points = np.random.default_rng(3).uniform([-0.2, -0.2, 1], [0.2, 0.2, 2], (20, 3)) * 1000
    for name in ("opencv", "ros", "colmap"):
        path = tmp_path / f"camera.{'txt' if name == 'colmap' else 'yml' if name == 'opencv' else 'yaml'}"
        fit.calibration.export(name, path)
        camera = depthcal.Calibration.load(path)
        assert camera.size == fit.calibration.size
        np.testing.assert_allclose(camera.project(points), fit.calibration.project(points), atol=1e-3)
    (tmp_path / "intrinsics.json").write_text('{"width": 640}')
    with pytest.raises(depthcal.InputError, match="intrinsics.json"):
        depthcal.Calibration.load(tmp_path / "intrinsics.json")
    fit.save(tmp_path / "fit")
    assert (
        depthcal.Calibration.load(tmp_path / "fit").record
        == depthcal.Calibration.load(tmp_path / "fit" / "calibration.json").record
    )


# --- Boards and recordings ----------------------------------------------------------------------------------------------------------


def test_boards_to_print_are_those_of_the_command_line(cli, tmp_path):
    cli(
        "board",
        "--kind",
        "charuco",
        "--columns",
        9,
        "--rows",
        6,
        "--spacing-mm",
        24,
        "--marker-mm",
        18,
        "--out",
        tmp_path / "c.svg",
    )
    board = depthcal.Board.charuco(9, 6, 24.0, 18.0, "DICT_5X5_250")
    written = board.save(tmp_path / "p.svg")
    assert [path.name for path in written] == ["p.svg", "p.toml"]
    assert (tmp_path / "p.svg").read_bytes() == (tmp_path / "c.svg").read_bytes()
    assert (tmp_path / "p.toml").read_bytes() == (tmp_path / "c.toml").read_bytes()


def test_boards_are_printed(tmp_path):
    pdf, _ = depthcal.Board.asymmetric_circles(4, 11, 17.0, 11.0).save(tmp_path / "b.pdf", paper="a3")
    assert pdf.read_bytes().startswith(b"%PDF")
    depthcal.Board.aprilgrid(6, 4, 40.0, 30.0).save(tmp_path / "a.svg")
    for wrong, words in [
        (lambda: depthcal.Board.chessboard(9, 6, 25.0).save(tmp_path / "b.png"), "pdf or .svg"),
        (lambda: depthcal.Board.chessboard(9, 6, 250.0).save(tmp_path / "b.pdf", paper="a4"), "larger paper"),
        (lambda: depthcal.Board.chessboard(9, 6, 25.0).save(tmp_path / "b.pdf", paper="a9"), "paper size"),
        (lambda: depthcal.Board.symmetric_circles(9, 6, 25.0).save(tmp_path / "b.pdf"), "diameter"),
    ]:
        with pytest.raises(depthcal.InputError, match=words):
            wrong()


def bag(path, images, depths):
    """A ROS 2 bag (SQLite) of images and depth, 10 a second, written without any of depthcal's code."""

    def message(array, encoding, time_ns):
        def text(value):
            raw = value.encode() + b"\0"
            return struct.pack("<I", len(raw)) + raw

        body = bytearray(struct.pack("<iI", time_ns // 10**9, time_ns % 10**9) + text("camera"))
        body += b"\0" * (-len(body) % 4)
        body += struct.pack("<II", *array.shape) + text(encoding) + b"\0"
        body += b"\0" * (-len(body) % 4)
        data = array.tobytes()
        body += struct.pack("<I", array.strides[0]) + struct.pack("<I", len(data)) + data
        return b"\0\1\0\0" + bytes(body)

    connection = sqlite3.connect(path)
    connection.execute(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
        "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)"
    )
    connection.execute(
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL)"
    )
    for number, name in ((1, "/camera/infra/image_raw"), (2, "/camera/depth/image_raw")):
        connection.execute("INSERT INTO topics VALUES (?, ?, 'sensor_msgs/msg/Image', 'cdr', '')", (number, name))
    for i, (gray, depth) in enumerate(zip(images, depths)):
        time_ns = 10**9 + i * 10**8
        for topic, array, encoding in ((1, gray, "mono8"), (2, depth, "16UC1")):
            connection.execute(
                "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
                (topic, time_ns, message(array, encoding, time_ns)),
            )
    connection.commit()
    connection.close()


def test_recordings_are_imported(images, tmp_path):
    if not hasattr(depthcal._depthcal, "import_recording"):
        pytest.skip("this build has no import of recordings")
    grays, depths = zip(*images.values())
    bag(tmp_path / "captures.db3", [np.repeat(g[None], 1, 0)[0] for g in grays], depths)
    imported = depthcal.import_recording(tmp_path / "captures.db3", tmp_path / "dataset", board=BOARD, frames=8)
    assert imported["frames"] == 8 and imported["depth"] == "/camera/depth/image_raw" and not imported["is_rig"]
    dataset = depthcal.load(tmp_path / "dataset", cache=False)
    assert len(dataset) == 8 and dataset.board == BOARD
    given = {depth.tobytes() for depth in depths}
    assert all(dataset.depth(row.name).tobytes() in given for row in dataset.frames)
    with pytest.raises(depthcal.InputError, match="a dataset already"):
        depthcal.import_recording(tmp_path / "captures.db3", tmp_path / "dataset")
    for wrong, words in [
        (dict(pair="never"), "pair"),
        (dict(frames=0), "frames is 0"),
        (dict(skip_s=-1.0), "skip_s"),
        (dict(image="/none"), "/none"),
    ]:
        with pytest.raises(depthcal.InputError, match=words):
            depthcal.import_recording(tmp_path / "captures.db3", tmp_path / "other", **wrong)


# --- What travels -------------------------------------------------------------------------------------------------------------------


def travelled(thing):
    return pickle.loads(pickle.dumps(thing))


def test_datasets_travel(dataset, points, rig, images, tmp_path):
    """The fit of what arrives has the same bytes."""
    for given in (dataset, points, rig):
        again = travelled(given)
        # As text: temperatures that are not known are NaN.
        assert again.digest == given.digest and repr(again.frames) == repr(given.frames)
        assert again.cameras == given.cameras
        assert list(again.dropped) == list(given.dropped)
        depthcal.calibrate(given).save(tmp_path / "here")
        depthcal.calibrate(again).save(tmp_path / "there")
        for name in ("calibration.json", "evaluation.json"):
            assert (tmp_path / "there" / name).read_bytes() == (tmp_path / "here" / name).read_bytes()
    name = dataset.frames[0].name
    np.testing.assert_array_equal(travelled(dataset).depth(name), dataset.depth(name))
    np.testing.assert_array_equal(travelled(dataset).image(name), dataset.image(name))
    dataset.write_observations(tmp_path / "a.json")
    travelled(dataset).write_observations(tmp_path / "b.json")
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def test_effects_that_need_conditions_travel(tmp_path):
    given = depthcal.simulate_points(frames=20, samples=60, effects=["reflectivity_bias=6", "temporal_drift=6"], seed=2)
    effects = ["reflectivity_bias", "temporal_drift"]
    here, there = (depthcal.calibrate(d, effects=effects) for d in (given, travelled(given)))
    assert list(here.calibration.parameters) == list(there.calibration.parameters)


def test_fits_travel(fit, rig_fit, tmp_path):
    for given in (fit, rig_fit):
        again = travelled(travelled(given))
        assert again.evaluation == given.evaluation and repr(again) == repr(given)
        assert again.calibration.record == given.calibration.record
        given.save(tmp_path / "here")
        written = again.save(tmp_path / "there")
        assert {path.relative_to(tmp_path / "there") for path in written} == {
            path.relative_to(tmp_path / "here") for path in (tmp_path / "here").rglob("*") if path.is_file()
        }
        for path in written:
            assert path.read_bytes() == (tmp_path / "here" / path.relative_to(tmp_path / "there")).read_bytes(), path
        assert again.report.html == (tmp_path / "here" / "report.html").read_text()
        with pytest.raises(depthcal.InputError, match="pickled"):
            again.next_captures()
    assert travelled(fit).scores() == fit.scores()


def test_correctors_travel(fit):
    depth = wave()
    for threads in (None, 1):
        corrector = depthcal.Corrector(fit.calibration, threads=threads)
        again = travelled(corrector)
        np.testing.assert_array_equal(again.correct(depth), corrector.correct(depth))
        np.testing.assert_array_equal(again.uncertainty(depth), corrector.uncertainty(depth))


def correct(corrector, depth):
    return corrector.correct(depth)


def test_spawned_workers_take_correctors(fit):
    corrector, depth = depthcal.Corrector(fit.calibration, threads=1), wave()
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        np.testing.assert_array_equal(pool.apply(correct, (corrector, depth)), corrector.correct(depth))


def test_functions_do_not_travel(points):
    @depthcal.effect(parameters={"a": "mm"}, name="bowl")
    def bowl(r, a):
        return a * r**2

    fit = depthcal.calibrate(points, effects=[bowl])
    for thing in (fit, fit.calibration):
        with pytest.raises(depthcal.InputError, match="bowl"):
            pickle.dumps(thing)


def test_an_exception_of_a_function_in_a_correction_is_its_own():
    """Effects of the amplitude have no tables: every pixel is inverted, by the function."""
    points = depthcal.simulate_points(frames=20, samples=60, effects=["reflectivity_bias=6"], seed=2)
    broken = []

    @depthcal.effect(parameters={"a": "mm"}, name="shade")
    def shade(r, amplitude, a):
        if broken:
            raise ZeroDivisionError("own message")
        return a * r**2 * 100 / (amplitude + 50)

    corrector = depthcal.Corrector(depthcal.calibrate(points, effects=[shade]).calibration)
    depth, amplitude = np.full((480, 640), 1500, np.uint16), np.full((480, 640), 100, np.uint16)
    assert not corrector.has_tables
    before = corrector.correct(depth, amplitude=amplitude)
    broken.append(True)
    for call in (corrector.correct, corrector.correct_counting, corrector.correct_to_mm, corrector.points):
        with pytest.raises(ZeroDivisionError, match="own message"):
            call(depth, amplitude=amplitude)
    broken.clear()
    np.testing.assert_array_equal(corrector.correct(depth, amplitude=amplitude), before)


# --- Fleets -------------------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def units():
    """Fits of six simulated units of one type."""
    points = [depthcal.simulate_points(frames=10, samples=60, unit=u, seed=100 + u) for u in range(6)]
    return [depthcal.calibrate(p, lens="brown-conrady:full") for p in points]


def test_a_fleet_of_fits_is_that_of_their_folders(units, tmp_path):
    for number, unit in enumerate(units):
        unit.save(tmp_path / f"unit{number}")
    of_folders = depthcal.fleet(tmp_path)
    of_fits = depthcal.fleet({f"unit{number}": unit for number, unit in enumerate(units)})
    assert list(of_fits.parameters) == list(of_folders.parameters) and list(of_fits.effects) == list(of_folders.effects)
    assert of_fits.prior == of_folders.prior and of_fits.units == of_folders.units
    travelled_units = depthcal.fleet([travelled(unit) for unit in units])
    assert list(travelled_units.effects) == list(of_fits.effects) and len(set(travelled_units.units)) == 6
    mixed = depthcal.fleet([tmp_path / "unit0", tmp_path / "unit1", *units[2:4], *(u.calibration for u in units[4:])])
    assert list(mixed.parameters) == list(of_fits.parameters)
    few = depthcal.simulate_points(frames=4, samples=60, unit=9, seed=109)
    assert "6 units" in depthcal.calibrate(few, lens="brown-conrady:full", prior=of_fits).prior_use[0]


def test_scores_are_those_of_the_file(units, tmp_path):
    import json

    units[0].save(tmp_path)
    scores = units[0].scores()
    assert scores["effects"] and scores == {
        key: value for key, value in json.loads((tmp_path / "scores.json").read_text()).items() if key in scores
    }


def test_what_is_no_unit_is_refused(units, rig_fit, points):
    for wrong, words in [
        ([units[0], points], "Dataset"),
        ([units[0], rig_fit], "several cameras"),
        (3, "int"),
    ]:
        with pytest.raises(depthcal.InputError, match=words):
            depthcal.fleet(wrong)


# --- Notebooks ----------------------------------------------------------------------------------------------------------------------


def test_what_a_notebook_shows_is_small(fit, dataset, points, units, rig_fit):
    results = [
        fit,
        rig_fit,
        depthcal.evaluate(fit, dataset),
        depthcal.diagnose(points, discovery=False),
        depthcal.compare(points, models=["none", "projective"], folds=3),
        depthcal.fleet(units),
        depthcal.diff(units[0], units[1]),
    ]
    for result in results:
        shown = result._repr_html_()
        assert len(shown.encode()) < 300_000 and "<pre>" in shown and "<script" not in shown, type(result)
    assert "<td>pinhole.fx</td>" in fit._repr_html_() and fit.report._repr_html_().startswith("<iframe")

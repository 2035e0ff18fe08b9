"""Results as objects: tables, figures, reports, files of other programs."""

import json
import pickle

import numpy as np
import pytest
from conftest import wave

import depthcal


def test_tables_are_data_frames(fit, dataset):
    pytest.importorskip("pandas")
    frame = fit.calibration.parameters.to_pandas()
    assert frame.loc["pinhole.fx", "unit"] == "px" and 400 < frame.loc["pinhole.fx", "value"] < 800
    assert frame.loc["pinhole.fx", "std_dev"] > 0 and not frame.loc["pinhole.fx", "fixed"]
    errors = fit.errors.to_pandas()
    assert errors.iloc[0]["depth_rms_mm"] < errors.iloc[0]["depth_rms_before_mm"]
    frames = fit.frames.to_pandas()
    assert len(frames) == len(fit.calibration.poses) == len(dataset.frames.to_pandas())
    # The record's own number, found through another way.
    assert (
        frames["depth_rms_mm"].iloc[0]
        == json.loads(fit._native.evaluation())["datasets"][0]["frames_detail"][0]["depth_rms_mm"]["after"]
    )
    covariance = fit.calibration.covariance
    fx = covariance.to_pandas().loc["pinhole.fx", "pinhole.fx"]
    assert np.isclose(np.sqrt(fx), frame.loc["pinhole.fx", "std_dev"], rtol=1e-6)
    correlation = np.asarray(fit.calibration.correlation)
    known = ~np.isnan(np.diag(correlation))
    assert np.allclose(np.diag(correlation)[known], 1) and np.nanmax(np.abs(correlation)) < 1 + 1e-6


def test_figures(fit, dataset, points):
    pytest.importorskip("pandas")
    plt = pytest.importorskip("matplotlib.pyplot")
    evaluation = depthcal.evaluate(fit.calibration, [dataset])
    diagnosis = depthcal.diagnose(points, discovery=False)
    for plot in (fit.plot, fit.calibration.plot, dataset.plot):
        ax = plot()
        assert ax.has_data()
        own = plt.subplots()[1]
        assert plot(ax=own) is own
        plt.close("all")
    assert evaluation.plot().has_data() and diagnosis.plot().has_data()
    plt.close("all")


def test_notebooks_show_results_inline(fit, dataset):
    page = fit.report._repr_html_()
    assert page.startswith("<iframe") and "srcdoc" in page
    assert fit.report.html.startswith("<!") and dataset.name in fit.report.html
    assert "<td>pinhole.fx</td>" in fit.calibration._repr_html_()
    assert "pinhole.fx" in repr(fit.calibration.parameters) and "px rms" in repr(fit)


def test_calibrations_travel_to_other_processes(fit):
    again = pickle.loads(pickle.dumps(fit.calibration))
    assert again.record == fit.calibration.record
    corrected = [depthcal.Corrector(c).correct(wave()) for c in (again, fit.calibration)]
    np.testing.assert_array_equal(*corrected)


def test_evaluation_on_another_capture(tmp_path):
    fit = depthcal.calibrate(depthcal.simulate_points(frames=16, samples=150, seed=3))
    other = depthcal.simulate_points(frames=6, samples=150, seed=8)
    evaluation = depthcal.evaluate(fit.calibration, [other])
    (row,) = evaluation.datasets
    assert row.frames == 6 and row.depth_rms_mm < row.depth_rms_before_mm
    assert evaluation.report.html
    assert {path.name for path in evaluation.save(tmp_path)} == {"evaluation.json", "report.html"}
    assert "dot error" in repr(evaluation)
    fit.save(tmp_path / "fit")
    evaluation.save(tmp_path / "fit")
    depthcal.calibrate(other).save(tmp_path / "other")
    before = (tmp_path / "other" / "evaluation.json").read_bytes()
    with pytest.raises(depthcal.InputError, match="a calibration other than .*another folder"):
        evaluation.save(tmp_path / "other")
    assert (tmp_path / "other" / "evaluation.json").read_bytes() == before


def test_a_diagnosis_names_what_was_planted():
    planted = depthcal.simulate_points(frames=24, samples=300, effects=["cyclic_depth=6"], seed=1)
    diagnosis = depthcal.diagnose(planted, discovery=False)
    assert diagnosis.verdict == "effect" and diagnosis.steps[0].effect == "cyclic_depth"
    step = diagnosis.steps[0]
    assert step.depth_rms_after_mm < step.depth_rms_before_mm and step.gain_low_percent > 0
    assert any(row.name.startswith("cyclic_depth.") for row in diagnosis.calibration.parameters)
    again = depthcal.calibrate(planted, effects=[step.with_])
    assert again.errors[0].depth_rms_mm < step.depth_rms_before_mm
    assert "cyclic_depth" in repr(diagnosis) and diagnosis.sentence in repr(diagnosis)

"""Formulas and numpy functions as effects: the same fit from both, and what is refused."""

import warnings

import numpy as np
import pytest

import depthcal


def formula():
    return depthcal.Effect.formula(
        "(a * (u - u0) / w + b * (v - v0) / h) * z / range",
        name="delay_formula",
        adds_to="depth",
        parameters={"a": "mm", "b": "mm"},
        constants={"u0": 320, "v0": 240, "w": 640, "h": 480},
    )


def function():
    @depthcal.effect(parameters={"a": "mm", "b": "mm"}, adds_to="depth")
    def delay(u, v, z, range, a, b):
        """A signal that arrives later the farther it travels over the chip."""
        return (a * (u - 320) / 640 + b * (v - 240) / 480) * z / range

    return delay


def values(fit, piece):
    return {row.name.split(".")[1]: row for row in fit.calibration.parameters if row.name.startswith(piece + ".")}


def test_a_function_and_its_formula_give_the_same_fit(points):
    by_formula = values(depthcal.calibrate(points, effects=[formula()]), "delay_formula")
    delay = function()
    by_function = values(depthcal.calibrate(points, effects=[delay]), "delay")
    for name in "ab":
        f, g = by_formula[name], by_function[name]
        assert abs(f.value - g.value) < 1e-3 * f.std_dev and abs(f.std_dev / g.std_dev - 1) < 1e-4, (f, g)
        assert f.unit == g.unit == "mm"
    cost = delay.cost
    assert cost.calls > 10 and cost.points > 20 * cost.calls and cost.seconds > 0


@pytest.mark.parametrize("adds_to", ["depth", "inverse_depth", "factor"])
@pytest.mark.parametrize("of", ["true", "measured"])
def test_places_and_forms_agree_with_formulas(points, adds_to, of):
    unit = {"depth": "mm", "inverse_depth": "1/mm", "factor": "1"}[adds_to]
    by_formula = depthcal.Effect.formula(
        "a * (r * r) + b * (incidence)", name="f", adds_to=adds_to, of=of, parameters={"a": unit, "b": unit}
    )

    @depthcal.effect(parameters={"a": unit, "b": unit}, adds_to=adds_to, of=of, name="g")
    def g(r, incidence, a, b):
        return a * r**2 + b * incidence

    f = values(depthcal.calibrate(points, effects=[by_formula]), "f")
    g = values(depthcal.calibrate(points, effects=[g]), "g")
    for name in "ab":
        assert abs(f[name].value - g[name].value) < 2e-3 * f[name].std_dev, (name, f, g)


def test_effects_take_part_in_compare_and_diagnose():
    planted = depthcal.simulate_points(frames=20, samples=250, effects=["quadratic_depth=8"], seed=1)

    @depthcal.effect(parameters={"c": "mm"}, name="parabola")
    def parabola(z, c):
        """Depth that bends."""
        return c * ((z - 900.0) / 600.0) ** 2

    comparison = depthcal.compare(
        planted, models=["none", "projective", ["projective", parabola], [formula(), "projective"]], folds=3
    )
    models = {row.model: row for row in comparison.models}
    assert models["projective+parabola"].depth_rms_mm < models["projective"].depth_rms_mm < models["none"].depth_rms_mm
    assert "delay_formula+projective" in models and comparison.models[0].model == "projective+parabola"
    diagnosis = depthcal.diagnose(planted, candidates=[parabola], discovery=False)
    assert "parabola" in {row.effect for row in diagnosis.candidates}
    added = [row.effect for row in diagnosis.steps]
    assert added and (
        "parabola" in added or "parabola" in diagnosis.steps[0].indistinguishable or added == ["quadratic_depth"]
    )


def test_a_calibration_with_a_function_is_read_with_it(points, tmp_path):
    delay = function()
    fit = depthcal.calibrate(points, effects=[delay])
    fit.calibration.save(tmp_path / "c.json")
    with pytest.raises(depthcal.InputError, match="delay"):
        depthcal.Calibration.load(tmp_path / "c.json")
    again = depthcal.Calibration.load(tmp_path / "c.json", effects=[delay])
    assert list(again.parameters) == list(fit.calibration.parameters)
    depth = np.full((480, 640), 1500, np.uint16)
    calls = delay.cost.calls
    corrected = depthcal.Corrector(again).correct_to_mm(depth)
    # In batches: fewer calls than a tenth of the pixels.
    assert 0 < delay.cost.calls - calls < depth.size / 10
    replaced = depthcal.calibrate(points, effects=[formula()]).calibration
    # A table of a function and of a formula: both within their tolerances of the same model.
    assert np.abs(corrected - depthcal.Corrector(replaced).correct_to_mm(depth)).max() < 0.05


def test_formulas_are_in_the_file_and_files_are_taken(points, tmp_path):
    (tmp_path / "delay.toml").write_text(formula().to_toml())
    fit = depthcal.calibrate(points, effects=[tmp_path / "delay.toml"])
    same = depthcal.calibrate(points, effects=[formula()])
    assert list(fit.calibration.parameters) == list(same.calibration.parameters)
    fit.calibration.save(tmp_path / "c.json")
    assert list(depthcal.Calibration.load(tmp_path / "c.json").parameters) == list(fit.calibration.parameters)
    (effect,) = depthcal.read_effects(tmp_path / "delay.toml")
    assert (effect.name, effect.parameters) == ("delay_formula", {"a": "mm", "b": "mm"})
    assert "u" in effect.equation and effect._repr_latex_().startswith("$")


def test_wrong_formulas_are_refused_with_the_place():
    with pytest.raises(depthcal.InputError, match="units clash"):
        depthcal.Effect.formula("a * (u - 320)", name="f", parameters={"a": "mm"})


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda z, a: a * z + 1.0, "zero there"),
        (lambda z, a: a * np.log(z - 1000.0), "finite"),
        (lambda z, a: a * (z - np.mean(z)), "other points"),
        (lambda z, a: a * np.sin(np.float32(z) / np.float32(1000)), "too rough"),
        (lambda z, a: a * np.sin(np.float16(z) / np.float16(1000)), "too rough"),
        (lambda z, a: a * np.floor(z / 0.05) * 0.05, "too rough"),
        (lambda z, a: a * 0.0 * z, "typical deviation"),
        (lambda z, c: c * z, "units are given"),
    ],
)
def test_functions_that_cannot_be_fitted_are_refused(make, words):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        with pytest.raises(depthcal.InputError, match=words):
            depthcal.effect(parameters={"a": "1"}, name="f")(make)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda z, a: a * np.abs(np.sin(z / 30.0)), "by 'z' jumps.*a kink"),
        (lambda z, a: a * np.maximum(z - 1234.5, 0.0), "by 'z' jumps from 0 to .* at z = 1234.5: a kink"),
        (lambda x, z, a: a * z * np.abs(x), "by 'x' jumps.*a kink"),
        (lambda z, a: np.abs(a) * z, "by 'a' jumps.*a kink"),
        (lambda z, a: a * np.interp(z, np.linspace(0, 5000, 26), np.sin(np.arange(26))), "a kink"),
        (lambda z, a: a * np.sin(z / 8.0), "a fast wave"),
    ],
)
def test_a_kink_is_a_warning_with_its_place(function, words):
    with pytest.warns(depthcal.EffectWarning, match=words):
        depthcal.effect(parameters={"a": "1"}, name="f")(function)


def test_smooth_functions_give_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        depthcal.effect(parameters={"a": "1"}, name="f")(lambda z, a: a * np.sin(z / 30.0))
        depthcal.effect(parameters={"a": "1"}, name="g")(lambda x, y, z, a: a * z * np.exp(-5 * (x * x + y * y)))
        function()


def test_exceptions_of_a_function_reach_the_caller(points):
    @depthcal.effect(parameters={"a": "mm"}, name="fails")
    def fails(x, a):
        if a > 1e-9 and len(x) != 200 and len(x) != 7:
            raise ZeroDivisionError("own message")
        return a * x

    with pytest.raises(ZeroDivisionError, match="own message"):
        depthcal.calibrate(points, effects=[fails])
    assert depthcal.calibrate(points).errors[0].depth_rms_mm > 0


def test_names_of_pieces_are_taken(points):
    @depthcal.effect(parameters={"a": "1"}, name="cyclic_depth")
    def f(z, a):
        return a * z

    with pytest.raises(depthcal.InputError, match="choose another"):
        depthcal.calibrate(points, effects=[f])

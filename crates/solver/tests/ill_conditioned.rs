//! Problems too ill-conditioned for normal equations, and undetermined combinations of variables.

use crate::common::{Bundle, LINEAR_SOLVERS, bundle};
use depthcal_solver::{
    Batch, Factor, Graph, Key, LinearSolver, Loss, Method, Options, Over, Scalar, Solution, Values, minimize,
};
use nalgebra::{SVector, Vector2, Vector3};

/// aᵀ x − b.
struct Row {
    a: Vector3<f64>,
    b: f64,
}

impl Factor<1> for Row {
    type Variables = (Vector2<f64>, SVector<f64, 1>);

    fn residual<T: Scalar>(&self, (p, q): Over<Self::Variables, T>) -> SVector<T, 1> {
        SVector::<T, 1>::new(p[0] * self.a[0] + p[1] * self.a[1] + q[0] * self.a[2] - self.b)
    }
}

/// Läuchli's matrix (Läuchli 1961): rows (1, 1, 1) and ε I. With ε² below the rounding error JᵀJ is singular, while J has
/// condition number √3/ε. The solution of the consistent system is (1, 2, −4).
fn lauchli(epsilon: f64) -> (Graph, Values, Key<Vector2<f64>>, Key<SVector<f64, 1>>) {
    let mut values = Values::new();
    let (p, q) = (values.insert(Vector2::zeros()), values.insert(SVector::<f64, 1>::zeros()));
    let x = Vector3::new(1.0, 2.0, -4.0);
    let mut batch = Batch::new("rows");
    for a in [Vector3::repeat(1.0), Vector3::x() * epsilon, Vector3::y() * epsilon, Vector3::z() * epsilon] {
        batch.push(Row { a, b: a.dot(&x) }, (p, q));
    }
    let mut graph = Graph::new();
    graph.add_batch(batch);
    (graph, values, p, q)
}

fn error(solution: &Solution, p: Key<Vector2<f64>>, q: Key<SVector<f64, 1>>) -> f64 {
    let (p, q) = (solution.values.get(p), solution.values.get(q));
    (Vector3::new(p[0], p[1], q[0]) - Vector3::new(1.0, 2.0, -4.0)).norm()
}

#[test]
fn qr_keeps_an_answer_that_normal_equations_lose() {
    let (graph, values, p, q) = lauchli(1e-9);
    for method in [Method::GaussNewton, Method::LevenbergMarquardt, Method::DogLeg { radius: 10.0 }] {
        let solve = |linear_solver| {
            let options = Options {
                method,
                linear_solver,
                gradient_tolerance: 0.0,
                cost_tolerance: 0.0,
                parameter_tolerance: 0.0,
                max_iterations: 60,
                ..Options::default()
            };
            minimize(&graph, values.clone(), &options).unwrap()
        };
        // Rounding errors of 1e-16 times a condition number of 1.7e9.
        let by_rows = solve(LinearSolver::SparseQr);
        assert!(error(&by_rows, p, q) < 1e-5, "{method:?} {} {}", error(&by_rows, p, q), by_rows.report);
        for linear_solver in [LinearSolver::Dense, LinearSolver::SparseCholesky] {
            let by_normal_equations = solve(linear_solver);
            assert!(error(&by_normal_equations, p, q) > 1.0, "{method:?} {}", by_normal_equations.report);
        }
    }
}

#[test]
fn what_normal_equations_take_for_undetermined_qr_may_not() {
    let (graph, values, ..) = lauchli(1e-8);
    let count = |linear_solver| {
        let options =
            Options { linear_solver, method: Method::GaussNewton, name_undetermined: true, ..Options::default() };
        minimize(&graph, values.clone(), &options).unwrap().report.undetermined.len()
    };
    assert_eq!(count(LinearSolver::Dense), 2);
    assert_eq!(count(LinearSolver::SparseQr), 0);
}

#[test]
fn undetermined_combinations_are_named_whatever_the_linear_solver() {
    let Bundle { mut graph, values, poses, .. } = bundle(6, 40, 0.3, Loss::Trivial, 12);
    graph.unfix(poses[0]);
    graph.unfix(poses[1]);
    poses.iter().enumerate().for_each(|(i, p)| graph.label(*p, format!("pose {i}")));
    for linear_solver in LINEAR_SOLVERS {
        let options = Options { linear_solver, name_undetermined: true, ..Options::default() };
        let solution = minimize(&graph, values.clone(), &options).unwrap();
        let report = &solution.report;
        assert!(report.converged, "{report}");
        // Rotation, translation and scale of everything.
        assert_eq!(report.undetermined.len(), 7, "{linear_solver:?} {report}");
        assert!(report.to_string().contains("pose"), "{report}");
        if let Some(weakest) = &report.weakest {
            assert!(weakest.suspect, "{linear_solver:?} {weakest:?}");
        }
        // A step along such a combination changes the cost in second order at most.
        for direction in &report.undetermined {
            let mut moved = solution.values.clone();
            let largest = direction.components.iter().fold(0.0_f64, |m, c| m.max(c.value.abs()));
            let mut delta = vec![vec![0.0; 6]; values.len()];
            direction.components.iter().for_each(|c| delta[c.variable.index()][c.component] = 1e-4 * c.value / largest);
            values.ids().for_each(|id| moved.retract(id, &delta[id.index()][..values.dim(id)]));
            let cost = graph.cost(&moved).unwrap();
            // Residuals of some hundreds of pixels per unit change by (1e-4)² of that.
            assert!((cost - report.cost).abs() < 1e-3 * report.cost, "{cost} {}", report.cost);
        }
    }
    // With the gauge fixed, everything is determined.
    graph.fix(poses[0]);
    graph.fix_partly(poses[1], &[false, false, false, true, false, false]);
    for linear_solver in LINEAR_SOLVERS {
        let options = Options { linear_solver, name_undetermined: true, ..Options::default() };
        let report = minimize(&graph, values.clone(), &options).unwrap().report;
        assert!(report.undetermined.is_empty(), "{linear_solver:?} {report}");
    }
}

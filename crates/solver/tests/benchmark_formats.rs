//! The readers of benchmark files that the examples use: contents, and errors that name the line.

mod bal_problems {
    use std::io::Write;
    use std::path::Path;

    use proptest::prelude::*;

    use crate::bal::BalProblem;
    use crate::words::ProblemFileError;

    const TEXT: &str = "1 2 2\n0 0 -3.859900e+02 3.871200e+02\n0 1 1.5 2.5\n\
                        0.1\n0.2\n0.3\n1\n2\n3\n500\n-1e-7\n1e-13\n1\n2\n3\n4\n5\n6\n";

    fn parse(text: &str) -> Result<BalProblem, ProblemFileError> {
        BalProblem::parse(Path::new("problem.txt"), text.as_bytes())
    }

    #[test]
    fn reads_plain_and_compressed() {
        let problem = parse(TEXT).unwrap();
        assert_eq!(problem.cameras, [[0.1, 0.2, 0.3, 1.0, 2.0, 3.0, 500.0, -1e-7, 1e-13]]);
        assert_eq!(problem.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert_eq!(problem.observations[0].pixel, [-385.99, 387.12]);

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("problem.txt.bz2");
        let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
        encoder.write_all(TEXT.as_bytes()).unwrap();
        let bytes = encoder.finish().unwrap();
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(BalProblem::read(&path).unwrap(), problem);
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(BalProblem::read(&path).unwrap_err().to_string().contains("problem.txt.bz2"));
    }

    #[test]
    fn faults_name_the_line() {
        for (text, line, part) in [
            ("1 2".to_owned(), 1, "number of observations"),
            (TEXT.replace("0 1 1.5", "0 2 1.5"), 3, "index of a point is 2"),
            (TEXT.replace("1.5", "x"), 3, "\"x\""),
            (TEXT.replace("1.5", "nan"), 3, "\"nan\""),
            (TEXT.replace("500\n", "\n"), 18, "ends before"),
            (format!("{TEXT}7"), 19, "\"7\""),
        ] {
            let message = parse(&text).unwrap_err().to_string();
            assert!(message.contains(&format!("problem.txt:{line}:")) && message.contains(part), "{message}");
        }
    }

    #[test]
    fn generated_streets_are_whole_problems() {
        let text = crate::street::generate(50);
        let problem = parse(&text).unwrap();
        assert_eq!((problem.cameras.len(), problem.points.len()), (50, 3000));
        let (mut of_points, mut of_cameras) = (vec![0; 3000], vec![0; 50]);
        for o in &problem.observations {
            of_points[o.point] += 1;
            of_cameras[o.camera] += 1;
            assert!(o.pixel.iter().all(|x| x.abs() < 600.0), "{:?}", o.pixel);
        }
        assert!(of_points.iter().all(|n| *n >= 3) && of_cameras.iter().all(|n| *n >= 30), "{of_cameras:?}");
        assert_eq!(text, crate::street::generate(50));
    }

    proptest! {
        #[test]
        fn any_text_is_no_panic(bytes in proptest::collection::vec(any::<u8>(), 0..99), text in "[0-9 .e\n-]{0,99}") {
            let _ = BalProblem::parse(Path::new("x"), &bytes);
            let _ = parse(&text);
        }
    }

    /// A problem of the benchmark, which is not part of the repository: in `DEPTHCAL_DATA`, or in `../shared/data` next to the
    /// workspace.
    #[test]
    fn a_problem_of_the_benchmark() {
        let Some(path) = crate::measured::measured("bal/problem-16-22106-pre.txt.bz2") else { return };
        let problem = BalProblem::read(path).unwrap();
        assert_eq!((problem.cameras.len(), problem.points.len(), problem.observations.len()), (16, 22106, 83718));
        assert!(problem.cameras.iter().all(|camera| (100.0..10_000.0).contains(&camera[6])), "focal lengths in px");
    }
}

mod pose_graphs {
    use std::collections::BTreeSet;
    use std::path::Path;

    use proptest::prelude::*;

    use crate::g2o::{G2oGraph, Se2Vertex};
    use crate::words::ProblemFileError;

    const PLANE: &str = "# made by hand\nVERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1.5 0 -0.5\n\nFIX 0\n\
                         EDGE_SE2 0 1 1.5 0.25 -0.5 1 2 3 4 5 6\n";
    const SPACE: &str = "EDGE_SE3:QUAT 7 8 1 2 3 0 0 0.6 0.8 1 0 0 0 0 9 2 0 0 0 0 3 0 0 0 4 0 0 5 0 6\n\
                         VERTEX_SE3:QUAT 7 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 8 1 2 3 0 0 0.6001 0.8\n";

    fn parse(text: &str) -> Result<G2oGraph, ProblemFileError> {
        G2oGraph::parse(Path::new("graph.g2o"), text.as_bytes())
    }

    #[test]
    fn reads_the_plane() {
        let graph = parse(PLANE).unwrap();
        assert_eq!(graph.se2_vertices[1], Se2Vertex { id: 1, pose: [1.5, 0.0, -0.5] });
        assert_eq!(graph.fixed, BTreeSet::from([0]));
        let edge = graph.se2_edges[0];
        assert_eq!((edge.from, edge.to, edge.measurement), (0, 1, [1.5, 0.25, -0.5]));
        assert_eq!(edge.information, [[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]]);
    }

    #[test]
    fn reads_space() {
        let graph = parse(SPACE).unwrap();
        assert_eq!(graph.se3_vertices[0].rotation, [1.0, 0.0, 0.0, 0.0]);
        let norm: f64 = graph.se3_vertices[1].rotation.iter().map(|q| q * q).sum();
        assert!((norm - 1.0).abs() < 1e-15);
        let edge = graph.se3_edges[0];
        assert_eq!((edge.translation, edge.rotation), ([1.0, 2.0, 3.0], [0.8, 0.0, 0.0, 0.6]));
        assert_eq!((edge.information[0][5], edge.information[5][0], edge.information[5][5]), (9.0, 9.0, 6.0));
    }

    #[test]
    fn a_file_that_cannot_be_read_is_named() {
        let message = G2oGraph::read("no/such/graph.g2o").unwrap_err().to_string();
        assert!(message.contains("no/such/graph.g2o"), "{message}");
    }

    #[test]
    fn faults_name_the_line() {
        for (text, line, part) in [
            (PLANE.replace("EDGE_SE2 0 1", "EDGE_SE2 0 2"), 6, "vertex 2"),
            (PLANE.replace("FIX 0", "FIX 0 5"), 5, "vertex 5"),
            (PLANE.replace("FIX 0", "FIX x"), 5, "\"x\""),
            (PLANE.replace("VERTEX_SE2 1 1.5", "VERTEX_SE2 1 ?"), 3, "\"?\""),
            (PLANE.replace("VERTEX_SE2 1", "VERTEX_SE2 0"), 3, "already"),
            (PLANE.replace(" 5 6", " 5"), 6, "ends before"),
            (PLANE.replace(" 5 6", " 5 6 7"), 6, "\"7\""),
            (PLANE.replace(" 5 6", " 5 -6"), 6, "diagonal"),
            (PLANE.replace("FIX", "VERTEX_XY"), 5, "unknown tag \"VERTEX_XY\""),
            (SPACE.replace("0 0 0 1\n", "0 0 0 0\n"), 2, "length 0"),
            (SPACE.replace("VERTEX_SE3:QUAT 7 0 0 0 0 0 0 1", "VERTEX_SE2 7 0 0 0"), 1, "vertex 7"),
        ] {
            let message = parse(&text).unwrap_err().to_string();
            assert!(message.contains(&format!("graph.g2o:{line}:")) && message.contains(part), "{message}");
        }
    }

    #[test]
    fn a_file_is_read_and_a_missing_one_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("graph.g2o");
        let message = G2oGraph::read(&path).unwrap_err().to_string();
        assert!(message.contains("graph.g2o: cannot read the file"), "{message}");
        std::fs::write(&path, PLANE).unwrap();
        assert_eq!(G2oGraph::read(&path).unwrap(), parse(PLANE).unwrap());
    }

    proptest! {
        #[test]
        fn any_text_is_no_panic(bytes in proptest::collection::vec(any::<u8>(), 0..99), numbers in "[0-9 .e-]{0,60}") {
            let _ = G2oGraph::parse(Path::new("x"), &bytes);
            for tag in ["VERTEX_SE2", "EDGE_SE2", "VERTEX_SE3:QUAT", "EDGE_SE3:QUAT", "FIX"] {
                let _ = parse(&format!("{tag} {numbers}"));
            }
        }
    }
}

//! The schemas in `docs/schemas` are those of the program, and that of `dataset.toml` accepts and refuses what the parser does.

use std::path::Path;

use depthcal_io::{DatasetFile, SchemaName};
use serde_json::{Value, json};

/// `UPDATE_DOCS=1 cargo test -p depthcal-io --test suite schemas` writes them.
#[test]
fn documented_schemas_are_current() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/schemas");
    for schema in SchemaName::ALL {
        let path = folder.join(format!("{}.json", schema.name()));
        let text = serde_json::to_string_pretty(&schema.schema()).unwrap() + "\n";
        if std::env::var_os("UPDATE_DOCS").is_some() {
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::write(&path, &text).unwrap();
        }
        let written = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(written == text, "{} is not current: run with UPDATE_DOCS=1", path.display());
    }
}

const BOARD: &str = "[board]\nkind = \"chessboard\"\ncolumns = 9\nrows = 6\nspacing_mm = 25\n";
const FRAMES: &str = "[frames]\nimage = \"image/*.png\"\n";

/// Whether the parser and the schema accept a text.
fn accepted(validator: &jsonschema::Validator, text: &str) -> (bool, bool) {
    let path = Path::new("dataset.toml");
    let parsed = DatasetFile::parse(path, text).is_ok();
    let value: toml::Value = toml::from_str(text).unwrap();
    let instance: Value = serde_json::to_value(value).unwrap();
    (parsed, validator.is_valid(&instance))
}

#[test]
fn the_schema_of_dataset_toml_agrees_with_its_parser() {
    let validator = jsonschema::validator_for(&SchemaName::Dataset.schema()).unwrap();
    let charuco = "[board]\nkind = \"charuco\"\ncolumns = 9\nrows = 6\nspacing_mm = 25\nmarker_mm = 18\ndictionary = \"DICT_5X5_100\"\n";
    let good = [
        format!("{BOARD}{FRAMES}"),
        format!("{BOARD}{FRAMES}depth = \"d/*.exr\"\nwithin_s = 0.02\n[depth]\nunit_mm = 1000.0\n"),
        format!("{BOARD}[frames]\nassociations = \"a.txt\"\n[depth]\nunit_mm = 0.2\n"),
        format!("{BOARD}[frames]\nmetadata = \"frames.csv\"\n"),
        format!("{charuco}{FRAMES}"),
        format!("{charuco}first_tag = 100\n{FRAMES}"),
        format!("{}{FRAMES}", BOARD.replace("chessboard", "symmetric-circles")),
        format!("{}{FRAMES}", BOARD.replace("chessboard", "aprilgrid").replace("rows = 6", "rows = 1\nmarker_mm = 18")),
        format!(
            "{BOARD}{FRAMES}[camera]\nfx = 500\nfy = 500.5\ncx = 320\ncy = 240\ndistortion = [0.1, 0, 0, 0]\nfixed = true\n"
        ),
    ];
    let camera = "[camera]\nfx = 500\nfy = 500.5\ncx = 320\ncy = 240\n";
    let eight = "distortion = [0.1, 0, 0, 0, 0, 0, 0, 0]\n";
    let good = good.into_iter().chain([
        format!("{BOARD}{FRAMES}{camera}{eight}lens = \"opencv8\"\n"),
        format!("{BOARD}{FRAMES}{camera}distortion = [0.1, 0, 0, 0]\nlens = \"kannala-brandt\"\n"),
        format!("{BOARD}{FRAMES}[camera]\nintrinsics = \"camera.yaml#left\"\nfixed = true\n"),
        format!("{BOARD}{FRAMES}[camera]\nlens = \"auto\"\n"),
    ]);
    for text in &good.collect::<Vec<_>>() {
        assert_eq!(accepted(&validator, text), (true, true), "{text}");
    }
    let bad = [
        FRAMES.to_owned(),
        BOARD.to_owned(),
        format!("{}{FRAMES}", BOARD.replace("columns", "colums")),
        format!("{}{FRAMES}", BOARD.replace("chessboard", "chess")),
        format!("{}{FRAMES}", BOARD.replace("rows = 6", "rows = 1")),
        format!("{}{FRAMES}", BOARD.replace("25", "0")),
        format!("{}{FRAMES}", charuco.replace("marker_mm = 18\n", "")),
        format!("{charuco}first_tag = -1\n{FRAMES}"),
        format!("{BOARD}[frames]\n"),
        format!("{BOARD}{FRAMES}[depth]\nunit_mm = 0.001\n"),
        format!("{BOARD}{FRAMES}[camera]\nfx = 500\n"),
        format!("{BOARD}{FRAMES}[camera]\nfx = 500\nfy = 500.5\ncx = 320\ncy = 240\ndistortion = [0.1]\n"),
        format!("{BOARD}{FRAMES}[lens]\nname = \"x\"\n"),
        format!("{BOARD}{FRAMES}{camera}{eight}lens = \"kannala-brandt\"\n"),
        format!("{BOARD}{FRAMES}{camera}intrinsics = \"camera.yaml\"\n"),
        format!("{BOARD}{FRAMES}[camera]\nintrinsics = \"camera.yaml\"\nskew = 0.1\n"),
        format!("{BOARD}{FRAMES}[camera]\nfixed = true\n"),
    ];
    for text in &bad {
        assert_eq!(accepted(&validator, text), (false, false), "{text}");
    }
}

#[test]
fn the_schema_of_rigs_agrees_with_their_parser() {
    let validator = jsonschema::validator_for(&SchemaName::Dataset.schema()).unwrap();
    let colour = "[cameras.colour]\nimage = \"colour/*.png\"\n";
    let depth = "[cameras.depth-2]\ndepth = \"depth/*.png\"\nunit_mm = 0.1\n";
    let numbers = "fx = 500\nfy = 500.5\ncx = 320\ncy = 240\n";
    let good = [
        format!("{BOARD}{colour}{depth}"),
        format!("{BOARD}{colour}lens = \"opencv8\"\n{depth}{numbers}fixed = true\n"),
        format!("{BOARD}{colour}intrinsics = \"factory.yml\"\n[frames]\nwithin_s = 0.02\nmetadata = \"frames.csv\"\n"),
    ];
    let wall = "[boards.wall]\nkind = \"aprilgrid\"\ncolumns = 6\nrows = 5\nspacing_mm = 39\nmarker_mm = 30\n";
    let floor = wall.replace("wall", "floor").replace("rows", "first_tag = 30\nrows");
    let good = good.into_iter().chain([format!("{wall}{floor}{colour}"), format!("{wall}{floor}{FRAMES}")]);
    for text in &good.collect::<Vec<_>>() {
        assert_eq!(accepted(&validator, text), (true, true), "{text}");
    }
    let bad = [
        format!("{wall}{BOARD}{colour}"),
        format!("{}{colour}", wall.replace("aprilgrid", "chessboard")),
        format!("{BOARD}{FRAMES}{colour}"),
        format!("{BOARD}{colour}[depth]\nunit_mm = 1\n"),
        format!("{BOARD}{colour}[camera]\n{numbers}"),
        format!("{BOARD}{}", depth.replace("unit_mm = 0.1\n", "")),
        format!("{BOARD}{}", depth.replace("unit_mm = 0.1", "unit_mm = 0.001")),
        format!("{BOARD}{colour}images = \"x\"\n"),
        format!("{BOARD}{colour}fx = 500\n"),
        format!("{BOARD}{colour}{numbers}intrinsics = \"factory.yml\"\n"),
        colour.to_owned(),
    ];
    for text in &bad {
        assert_eq!(accepted(&validator, text), (false, false), "{text}");
    }
}

#[test]
fn versioned_files_require_their_format() {
    let schema = SchemaName::Calibration.schema();
    assert_eq!(schema["properties"]["format"]["const"], json!("depthcal-calibration"));
    assert!(schema["required"].as_array().unwrap().contains(&json!("version")));
    let validator = jsonschema::validator_for(&schema).unwrap();
    assert!(!validator.is_valid(&json!({ "format": "depthcal-calibration", "version": 2 })));
}

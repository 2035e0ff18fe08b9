//! Files that commands write, held against their schemas.
//!
//! The checker knows the keywords that schemas of results have; one that it does not know fails the test. A validator of others
//! is used by `crates/io/tests/schemas.rs`: as a dependency here it would have everything built a second time, with other
//! features.

use std::path::Path;

use depthcal::io::SchemaName;
use serde_json::{Map, Value, json};

/// Expects that a JSON file is what the schema `name` says.
pub fn follows(path: impl AsRef<Path>, name: &str) {
    let path = path.as_ref();
    let schema = SchemaName::ALL.into_iter().find(|schema| schema.name() == name).expect("a schema").schema();
    let value = serde_json::from_str(&std::fs::read_to_string(path).expect("a file that was written")).expect("JSON");
    let faults = faults(&schema, &schema, &value, "");
    assert!(faults.is_empty(), "{}: {}", path.display(), faults.join("\n"));
}

/// The contradictions of the value at `place` to a schema; `root` has its definitions.
fn faults(root: &Value, schema: &Value, value: &Value, place: &str) -> Vec<String> {
    let Value::Object(keywords) = schema else {
        return if schema == &Value::Bool(true) { Vec::new() } else { vec![format!("{place}: nothing may be here")] };
    };
    keywords.iter().flat_map(|(keyword, rule)| broken(root, keywords, (keyword, rule), value, place)).collect()
}

/// The contradictions of a value to one keyword of a schema.
fn broken(
    root: &Value,
    keywords: &Map<String, Value>,
    (keyword, rule): (&str, &Value),
    value: &Value,
    place: &str,
) -> Vec<String> {
    let unless = |holds: bool| if holds { Vec::new() } else { vec![format!("{place}: not {keyword} {rule}: {value}")] };
    let members = |value: &Value| value.as_object().cloned().unwrap_or_default().into_iter();
    let list = || rule.as_array().expect("an array").iter();
    let matching = || list().filter(|schema| faults(root, schema, value, place).is_empty()).count();
    let number =
        |holds: fn(f64, f64) -> bool| value.as_f64().is_none_or(|v| holds(v, rule.as_f64().expect("a number")));
    let length = |holds: fn(usize, usize) -> bool| {
        value.as_array().is_none_or(|v| holds(v.len(), rule.as_u64().expect("a number") as usize))
    };
    match keyword {
        "$schema" | "$defs" | "title" | "description" | "default" | "format" => Vec::new(),
        "$ref" => {
            let pointer = rule.as_str().and_then(|r| r.strip_prefix('#')).expect("a reference within the schema");
            faults(root, root.pointer(pointer).expect("a definition"), value, place)
        }
        "type" => {
            unless(rule.as_array().map_or(vec![rule], |types| types.iter().collect()).iter().any(|r| is(value, r)))
        }
        "const" => unless(value == rule),
        "anyOf" => unless(matching() > 0),
        "oneOf" => unless(matching() == 1),
        "minimum" => unless(number(|v, limit| v >= limit)),
        "maximum" => unless(number(|v, limit| v <= limit)),
        "minItems" => unless(length(|n, limit| n >= limit)),
        "maxItems" => unless(length(|n, limit| n <= limit)),
        "required" => {
            unless(!value.is_object() || list().all(|name| value.get(name.as_str().expect("a name")).is_some()))
        }
        "items" => {
            let items = value.as_array().into_iter().flatten().enumerate();
            items.flat_map(|(i, item)| faults(root, rule, item, &format!("{place}/{i}"))).collect()
        }
        "properties" => {
            let here = members(rule).filter_map(|(name, schema)| Some((value.get(&name)?, name, schema)));
            here.flat_map(|(member, name, schema)| faults(root, &schema, member, &format!("{place}/{name}"))).collect()
        }
        "additionalProperties" => {
            let declared = keywords.get("properties").cloned().unwrap_or_else(|| json!({}));
            let others = members(value).filter(|(name, _)| declared.get(name).is_none());
            others.flat_map(|(name, member)| faults(root, rule, &member, &format!("{place}/{name}"))).collect()
        }
        _ => panic!("the checker does not know the keyword {keyword:?}: add it"),
    }
}

fn is(value: &Value, name: &Value) -> bool {
    match name.as_str().expect("the name of a type") {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.as_f64().is_some_and(|v| v.fract() == 0.0),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        other => panic!("there is no type {other:?} in JSON"),
    }
}

#[test]
fn every_keyword_refuses_what_it_is_for() {
    let refuses = |schema: Value, value: Value| !faults(&schema, &schema, &value, "").is_empty();
    let accepts = |schema: &Value, value: Value| faults(schema, schema, &value, "").is_empty();
    let schema = json!({
        "$defs": { "pair": { "type": "array", "items": { "type": "number", "minimum": 0, "maximum": 9 }, "minItems": 2, "maxItems": 2 } },
        "type": "object", "required": ["kind"], "additionalProperties": false,
        "properties": {
            "kind": { "oneOf": [{ "const": "a" }, { "const": "b" }] },
            "pair": { "anyOf": [{ "$ref": "#/$defs/pair" }, { "type": "null" }] },
            "count": { "type": ["integer", "null"] },
        },
    });
    assert!(accepts(&schema, json!({ "kind": "a", "pair": [0, 9.0], "count": 3 })));
    assert!(accepts(&schema, json!({ "kind": "b", "pair": null, "count": null })));
    for wrong in [
        json!({}),
        json!([]),
        json!({ "kind": "c" }),
        json!({ "kind": "a", "more": 1 }),
        json!({ "kind": "a", "count": 0.5 }),
        json!({ "kind": "a", "pair": [1] }),
        json!({ "kind": "a", "pair": [1, 2, 3] }),
        json!({ "kind": "a", "pair": [-1, 2] }),
        json!({ "kind": "a", "pair": [1, 10] }),
        json!({ "kind": "a", "pair": [1, "2"] }),
    ] {
        assert!(refuses(schema.clone(), wrong.clone()), "{wrong}");
    }
    assert!(refuses(json!({ "oneOf": [{ "type": "number" }, { "const": 1 }] }), json!(1)));
    assert!(refuses(json!({ "additionalProperties": { "type": "null" } }), json!({ "x": 1 })));
}

//! `/api/v1/openapi.json`: the window for programs that write programs (OpenAPI 3.1), from the same tables as its routes.

use serde_json::{Map, Value, json};

use super::gimbals::PARTS;
use super::routes::GIMBALS;
use crate::actions::{ACTIONS, Action, CONFIRM, Field, Kind};

pub fn description() -> Value {
    let mut paths = Map::new();
    let mut add = |path: String, method: &str, operation: Value| {
        let entry = paths.entry(path).or_insert_with(|| json!({}));
        entry[method] = operation;
    };
    for (path, about) in [
        ("/api/v1/status", "Everything that there is to see"),
        (GIMBALS, "The names of the gimbals"),
        ("/healthz", "Whether the process is alive"),
        ("/readyz", "Whether all that is configured is there"),
    ] {
        add(path.to_owned(), "get", reading(about, &[]));
    }
    let of_gimbal = |rest: &str| format!("{GIMBALS}/{{name}}{rest}");
    let name = parameter("name", "the gimbal", &json!({"type": "string"}));
    add(of_gimbal(""), "get", reading("All of one gimbal", &[&name]));
    for (part, about) in PARTS {
        add(of_gimbal(&format!("/{part}")), "get", reading(about, &[&name]));
    }
    let of_parameter = parameter("parameter", "its name", &json!({"type": "string"}));
    add(of_gimbal("/parameters/{parameter}"), "get", reading("One parameter", &[&name, &of_parameter]));
    for action in ACTIONS {
        let in_path = action.path_field().map(|field| parameter(field.name, field.about, &schema(field)));
        let parameters: Vec<&Value> = [Some(&name), in_path.as_ref()].into_iter().flatten().collect();
        add(of_gimbal(&format!("/{}", action.path)), "post", asking(action, &parameters));
    }
    json!({
        "openapi": "3.1.0",
        "info": {"title": "gimbald", "version": env!("CARGO_PKG_VERSION"), "license": {"name": "MIT OR Apache-2.0"}},
        "paths": paths,
        "components": {"securitySchemes": {"token": {"type": "http", "scheme": "bearer"}}},
    })
}

fn reading(about: &str, parameters: &[&Value]) -> Value {
    let responses = json!({
        "200": {"description": "as JSON"},
        "404": {"description": "no such gimbal"},
        "503": {"description": "the core did not answer"},
    });
    json!({"summary": about, "parameters": parameters, "responses": responses})
}

fn asking(action: &Action, parameters: &[&Value]) -> Value {
    let mut properties = Map::new();
    for field in action.body_fields() {
        properties.insert(field.name.to_owned(), schema(field));
    }
    if let Some(word) = action.word {
        properties.insert(CONFIRM.to_owned(), json!({"const": word, "description": "what is dangerous needs it"}));
    }
    let required: Vec<&str> = action.body_fields().filter(|field| field.required).map(|field| field.name).collect();
    let body = json!({
        "type": "object",
        "additionalProperties": false,
        "properties": properties,
        "required": required,
    });
    json!({
        "summary": action.about,
        "operationId": action.command,
        "security": [{"token": []}],
        "parameters": parameters,
        "requestBody": {"required": !required.is_empty(), "content": {"application/json": {"schema": body}}},
        "responses": {
            "200": {"description": "done"},
            "400": {"description": "the body is no JSON object"},
            "401": {"description": "no token"},
            "403": {"description": "a wrong token, none configured, another origin, or not allowed by the configuration"},
            "404": {"description": "no such gimbal"},
            "409": {"description": "not in control; holder says who is"},
            "422": {"description": "something in the body is wrong"},
            "501": {"description": "this gimbal has no such function"},
            "502": {"description": "the gimbal did not do it"},
            "503": {"description": "not for the moment"},
            "504": {"description": "no answer"},
        },
    })
}

fn parameter(name: &str, about: &str, schema: &Value) -> Value {
    json!({"name": name, "in": "path", "required": true, "description": about, "schema": schema})
}

fn schema(field: &Field) -> Value {
    let mut schema = match field.kind {
        Kind::Number { min, max } => json!({"type": "number", "minimum": min, "maximum": max}),
        Kind::Word(words) => json!({"type": "string", "enum": words}),
        Kind::WholeOrWord { min, max, words } => json!({
            "oneOf": [{"type": "integer", "minimum": min, "maximum": max}, {"type": "string", "enum": words}],
        }),
        Kind::Flag => json!({"type": "boolean"}),
        Kind::Name { longest } => json!({"type": "string", "minLength": 1, "maxLength": longest}),
    };
    schema["description"] = field.about.into();
    schema
}

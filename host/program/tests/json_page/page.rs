//! Writes the pages: a list of fields for each type that an output holds, and a list of the outputs of the studies.

use super::source::{Definition, Field, Module, Shape, Source};
use std::borrow::Cow;
use std::collections::VecDeque;
use std::fmt::Write as _;
use syn::{GenericArgument, PathArguments, Type};

/// A file that the program writes.
#[derive(Clone)]
pub(super) struct Output {
    pub(super) title: Cow<'static, str>,
    /// The value of its field `schema`; empty for lines of JSON.
    pub(super) schema: &'static str,
    pub(super) about: &'static str,
    /// The type that is written, from its crate on.
    pub(super) root: &'static str,
}

/// The page, and what is missing in the sources.
#[derive(Default)]
pub(super) struct Page {
    pub(super) text: String,
    pub(super) without_unit: Vec<String>,
    pub(super) without_words: Vec<String>,
}

const HEAD: &str = "\
# JSON outputs

<!-- Generated from the sources by `PALPATE_RENEW=1 cargo test --release -p palpate --test json_page`. Do not edit. -->

`--json FILE` writes what a command prints, and more, for programs. This page lists every field, with the unit of every
number that has one. [The report](../report/src/files.md) lists the files of the studies (`palpate sweep`, `bench` and `stress`).

The field `schema` names the layout: its number changes when the meaning of a field changes. New fields may
be added without a change of the number, so a program should ignore fields that it does not know. A number that is not
finite is written as `null`.

After the name of a field stand its type and unit. `[T]` is a list of `T`, `{T}` an object with a `T` for each name, and `T?` a `T`
or `null`. A field with `~` is left out if it has no value. A name in bold is a type of this page.
";

const LIST: &str = "\
# Files of the studies

<!-- Generated from the sources by `PALPATE_RENEW=1 cargo test --release -p palpate --test json_page`. Do not edit. -->

`--json FILE` of a study writes what the study prints, and more, for programs. The doc comments of the types below describe
every field with its unit; `cargo doc --workspace --no-deps --open` shows them. [The book](../../src/json.md) has the files
that other commands write.

The studies of `palpate stress` write JSON Lines. The first line is the header of the study (study, schema, seed, number
of cells, settings). Each further line is a cell: its number (`cell`) and the fields of its result.

| command | schema | contents | type | fields |
|---|---|---|---|---|
";

/// The list of the files of the studies.
pub(super) fn list(source: &Source, outputs: &[Output]) -> String {
    let mut text = LIST.to_owned();
    for output in outputs {
        let root = root(source, output);
        let fields = match &root.shape {
            Shape::Struct(fields) => fields.as_slice(),
            _ => &[],
        };
        let names = fields.iter().map(|field| field.name.as_str());
        let names: Vec<_> = names.filter(|name| !name.is_empty()).collect();
        let schema = match output.schema {
            "" => "in the header".to_owned(),
            schema => format!("`{schema}`"),
        };
        let _ = writeln!(
            text,
            "| {} | {schema} | {} | `{}` | {} |",
            output.title,
            output.about,
            output.root,
            names.join(", ")
        );
    }
    text
}

/// The type that an output writes.
fn root<'a>(source: &'a Source, output: &Output) -> &'a Definition {
    let path: Vec<String> = output.root.split("::").map(str::to_owned).collect();
    let root = source.find(&Module::new(), &path);
    root.unwrap_or_else(|| panic!("{} is no type that serde writes", output.root))
}

/// The page on `outputs`.
pub(super) fn page(source: &Source, outputs: &[Output]) -> Page {
    let mut page = Page {
        text: HEAD.to_owned(),
        ..Page::default()
    };
    // Each type once, in the order of first use.
    let mut known = Vec::new();
    for output in outputs {
        page.output(source, output, &mut known);
    }
    page
}

impl Page {
    fn output(&mut self, source: &Source, output: &Output, known: &mut Vec<(Module, String)>) {
        let root = root(source, output);
        let _ = write!(self.text, "\n## {}\n\n{}", output.title, output.about);
        if !output.schema.is_empty() {
            let _ = write!(self.text, " Schema: `{}`.", output.schema);
        }
        self.text.push('\n');
        assert!(
            output.schema.is_empty() || source.has_string(output.schema),
            "{}: no source has the schema {:?}; correct it in tests/json_page.rs",
            output.title,
            output.schema
        );
        known.push(key(root));
        let mut waiting = VecDeque::from([root]);
        while let Some(definition) = waiting.pop_front() {
            let mut walk = Walk {
                source,
                output,
                found: Vec::new(),
                page: self,
            };
            walk.definition(definition, definition.name == root.name);
            for inner in walk.found {
                if !known.contains(&key(inner)) {
                    known.push(key(inner));
                    waiting.push_back(inner);
                }
            }
        }
    }
}

fn key(definition: &Definition) -> (Module, String) {
    (definition.module.clone(), definition.name.clone())
}

struct Walk<'a, 'p> {
    source: &'a Source,
    output: &'a Output,
    /// The types that the fields name.
    found: Vec<&'a Definition>,
    page: &'p mut Page,
}

impl<'a> Walk<'a, '_> {
    fn definition(&mut self, definition: &'a Definition, is_root: bool) {
        if !is_root {
            let heading = format!("\n### {}\n\n", title(definition));
            self.page.text += &heading;
            self.page.text += &plain(&definition.doc);
            self.page.text.push('\n');
        }
        match &definition.shape {
            Shape::Struct(fields) => self.fields(definition, fields),
            Shape::Wrapper(_) => {}
            Shape::Enum(variants) => {
                for variant in variants {
                    let tag = match &definition.tag {
                        Some(tag) => format!("`{tag}` is `{}`", variant.name),
                        None => format!("`{}`", variant.name),
                    };
                    let _ = write!(self.page.text, "\n{tag}: {}\n", plain(&variant.doc));
                    let outer = Definition {
                        doc: variant.doc.clone(),
                        ..definition.clone()
                    };
                    if !variant.fields.is_empty() {
                        self.fields(&outer, &variant.fields);
                    }
                }
            }
        }
    }

    fn fields(&mut self, definition: &Definition, fields: &[Field]) {
        self.page.text.push('\n');
        self.rows(definition, fields);
    }

    fn rows(&mut self, definition: &Definition, fields: &[Field]) {
        for field in fields {
            if field.flat
                && let Some(inner) = self.definition_of(&field.ty, &definition.module)
                && let Shape::Struct(inner_fields) = &inner.shape
            {
                self.rows(inner, inner_fields);
                continue;
            }
            let place = format!("{}: {}.{}", self.output.title, definition.name, field.name);
            let mut ty = self.describe(&field.ty, &definition.module);
            let mut meaning = plain(&field.doc);
            if field.name == "schema" && !self.output.schema.is_empty() {
                meaning = format!("`{}`.", self.output.schema);
            }
            if meaning.is_empty() {
                self.page.without_words.push(place.clone());
            }
            let unit = unit(&field.doc, &definition.doc);
            if is_real(&field.ty) && unit.is_none() {
                self.page.without_unit.push(format!("{place}: {meaning}"));
            }
            // A count has no unit, whatever the comment of its type says.
            let unit = if is_real(&field.ty) {
                unit
            } else {
                in_parentheses(&field.doc).filter(|_| is_whole(&field.ty))
            };
            let unit = unit.filter(|unit| unit != NONE && unit != ELSEWHERE);
            if let Some(unit) = unit {
                let _ = write!(ty, ", {unit}");
                // The type has it.
                meaning = meaning.replace(&format!(" ({unit})"), "");
            }
            let absent = if field.may_miss { "~" } else { "" };
            let name = match field.name.as_str() {
                "" => String::new(),
                name => format!("`{name}`{absent} "),
            };
            let _ = writeln!(self.page.text, "- {name}({ty}): {meaning}");
        }
    }

    fn definition_of(&self, ty: &Type, module: &Module) -> Option<&'a Definition> {
        let Type::Path(path) = ty else {
            return None;
        };
        let segments: Vec<_> = path.path.segments.iter().collect();
        let names: Vec<_> = segments.iter().map(|s| s.ident.to_string()).collect();
        self.source.find(module, &names)
    }

    /// A type in words. Notes the types that it names.
    fn describe(&mut self, ty: &Type, module: &Module) -> String {
        match ty {
            Type::Reference(reference) => self.describe(&reference.elem, module),
            Type::Slice(slice) => format!("[{}]", self.describe(&slice.elem, module)),
            Type::Array(array) => {
                let length = match &array.len {
                    syn::Expr::Lit(literal) => match &literal.lit {
                        syn::Lit::Int(number) => format!("; {number}"),
                        _ => String::new(),
                    },
                    _ => String::new(),
                };
                format!("[{}{length}]", self.describe(&array.elem, module))
            }
            Type::Tuple(tuple) => {
                let parts = tuple.elems.iter().map(|part| self.describe(part, module));
                format!("[{}]", parts.collect::<Vec<_>>().join(", "))
            }
            Type::Path(path) => {
                let Some(last) = path.path.segments.last() else {
                    panic!("a type without a name")
                };
                let inner: Vec<&Type> = match &last.arguments {
                    PathArguments::AngleBracketed(arguments) => arguments
                        .args
                        .iter()
                        .filter_map(|argument| match argument {
                            GenericArgument::Type(ty) => Some(ty),
                            _ => None,
                        })
                        .collect(),
                    _ => Vec::new(),
                };
                match (last.ident.to_string().as_str(), inner.as_slice()) {
                    ("f64" | "f32", _) => "number".into(),
                    ("u8" | "u16" | "u32" | "u64" | "usize" | "i32" | "i64", _) => "integer".into(),
                    ("bool", _) => "boolean".into(),
                    ("String" | "str" | "PathBuf", _) => "text".into(),
                    // The comparison of a replay writes values and fields as texts.
                    ("Value" | "Field", _) if is_compared(module) => "text".into(),
                    ("Value", _) => "any".into(),
                    ("Option", [inner]) => format!("{}?", self.describe(inner, module)),
                    ("Vec", [inner]) => format!("[{}]", self.describe(inner, module)),
                    ("Box" | "Arc", [inner]) => self.describe(inner, module),
                    ("BTreeMap" | "HashMap", [_, inner]) => {
                        format!("{{{}}}", self.describe(inner, module))
                    }
                    _ => self.named(ty, module),
                }
            }
            _ => panic!(
                "{}: a type that json_page/page.rs cannot describe",
                self.output.title
            ),
        }
    }

    fn named(&mut self, ty: &Type, module: &Module) -> String {
        let Some(definition) = self.definition_of(ty, module) else {
            let name = match ty {
                Type::Path(path) => path.path.segments.last().map(|s| s.ident.to_string()),
                _ => None,
            };
            panic!(
                "{}: {} in {module:?} is no type that serde derives; describe it in json_page/page.rs",
                self.output.title,
                name.unwrap_or_default()
            )
        };
        match &definition.shape {
            Shape::Wrapper(inner) => self.describe(&inner.clone(), &definition.module.clone()),
            Shape::Enum(variants) if variants.iter().all(|v| v.fields.is_empty()) => {
                let names: Vec<_> = variants.iter().map(|v| format!("`{}`", v.name)).collect();
                names.join(" or ")
            }
            _ => {
                self.found.push(definition);
                format!("**{}**", title(definition))
            }
        }
    }
}

/// Whether a module is the comparison of a replay with its log.
fn is_compared(module: &Module) -> bool {
    module.last().is_some_and(|name| name == "compare")
}

/// The heading of a type: its name, without the words that every type of summaries has.
fn title(definition: &Definition) -> String {
    definition.name.clone()
}

/// Text of a doc comment for the page: links within the documentation are names.
fn plain(doc: &str) -> String {
    let mut text = String::new();
    let mut rest = doc;
    while let Some(start) = rest.find("[`") {
        let (before, link) = rest.split_at(start);
        text += before;
        let Some(end) = link.find("`]") else {
            break;
        };
        let name = &link[2..end];
        let _ = write!(text, "`{}`", name.rsplit("::").next().unwrap_or(name));
        rest = &link[end + 2..];
        // The target of a link with a text.
        if rest.starts_with('(')
            && let Some(close) = rest.find(')')
        {
            rest = &rest[close + 1..];
        }
    }
    text += rest;
    // What is `None` in the program is `null` in JSON.
    text.replace("`None`", "`null`")
}

/// Whether a type holds numbers that are not whole.
fn is_real(ty: &Type) -> bool {
    match ty {
        Type::Reference(reference) => is_real(&reference.elem),
        Type::Slice(slice) => is_real(&slice.elem),
        Type::Array(array) => is_real(&array.elem),
        Type::Tuple(tuple) => tuple.elems.iter().any(is_real),
        Type::Path(path) => path.path.segments.last().is_some_and(|last| {
            let inner = match &last.arguments {
                PathArguments::AngleBracketed(arguments) => {
                    arguments.args.iter().any(|argument| match argument {
                        GenericArgument::Type(ty) => is_real(ty),
                        _ => false,
                    })
                }
                _ => false,
            };
            inner || last.ident == "f64" || last.ident == "f32"
        }),
        _ => false,
    }
}

/// Whether a type holds whole numbers.
fn is_whole(ty: &Type) -> bool {
    match ty {
        Type::Array(array) => is_whole(&array.elem),
        Type::Path(path) => path.path.segments.last().is_some_and(|last| {
            ["u8", "u16", "u32", "u64", "usize", "i32", "i64"]
                .iter()
                .any(|name| last.ident == name)
        }),
        _ => false,
    }
}

/// Units that stand in parentheses, alone or before a comma.
const UNITS: &[&str] = &[
    "m",
    "mm",
    "s",
    "ns",
    "us",
    "ms",
    "N",
    "N m",
    "N s/m",
    "N m s/rad",
    "N/m",
    "N/s",
    "N m/rad",
    "J",
    "mJ",
    "Pa",
    "kg",
    "Hz",
    "m/s",
    "rad/s",
    "rad",
    "ticks",
    "bytes",
    "bytes/s",
    "m/s^2",
    "m^2",
    "J/m^2",
    "degrees",
    "kg/m^2",
    "kg/m^3",
    "1/s",
];

/// Stands for the unit of a number that has none, and for a unit that the comment refers to.
const NONE: &str = "1";
const ELSEWHERE: &str = "see there";

/// Words that say that a number has no unit.
const PURE: &[&str] = &[
    "fraction",
    "factor",
    "relative",
    "ratio",
    "order of",
    "number of",
    "exponent",
    "multiple",
    "from 0 to 1",
    "relaxed (0)",
];

/// Words that refer to a unit in another field.
const REFERENCES: &[&str] = &[
    "in `unit`",
    "unit of the series",
    "unit of the family",
    "unit of the quantity",
];

/// The unit of a field: its comment names it, says that there is none (`1`), or names the place that does; else the
/// comment of its type does.
pub(super) fn unit(field: &str, definition: &str) -> Option<String> {
    [field, definition].iter().find_map(|doc| {
        let words = doc.to_lowercase();
        let has = |known: &[&str]| known.iter().any(|word| words.contains(word));
        let elsewhere = || has(REFERENCES).then(|| ELSEWHERE.to_owned());
        let pure = || has(PURE).then(|| NONE.to_owned());
        in_parentheses(doc).or_else(elsewhere).or_else(pure)
    })
}

/// The units that stand in parentheses.
fn in_parentheses(doc: &str) -> Option<String> {
    let mut found: Vec<&str> = Vec::new();
    for (place, _) in doc.match_indices('(') {
        let named = UNITS.iter().find(|unit| {
            let after = doc[place + 1..].strip_prefix(**unit);
            after.is_some_and(|after| after.starts_with([')', ',', ';']))
        });
        found.extend(named.filter(|unit| !found.contains(*unit)));
    }
    (!found.is_empty()).then(|| found.join(", "))
}

//! The types of the workspace's sources, and what a name means in a module.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use syn::{Attribute, Expr, Fields, Item, Lit, Meta, Type, UseTree};

/// A module, from its crate on.
pub(super) type Module = Vec<String>;

/// A type that serde writes.
#[derive(Clone)]
pub(super) struct Definition {
    pub(super) module: Module,
    pub(super) name: String,
    pub(super) doc: String,
    pub(super) shape: Shape,
    /// The key that names the variant of an enum.
    pub(super) tag: Option<String>,
}

#[derive(Clone)]
pub(super) enum Shape {
    Struct(Vec<Field>),
    /// A struct of one nameless field, written as the field.
    Wrapper(Type),
    Enum(Vec<Variant>),
}

#[derive(Clone)]
pub(super) struct Variant {
    /// Its name in JSON.
    pub(super) name: String,
    pub(super) doc: String,
    pub(super) fields: Vec<Field>,
}

#[derive(Clone)]
pub(super) struct Field {
    /// Its name in JSON; empty in a variant without names.
    pub(super) name: String,
    pub(super) doc: String,
    pub(super) ty: Type,
    /// Whether its own fields stand in its place.
    pub(super) flat: bool,
    /// Whether it may be left out.
    pub(super) may_miss: bool,
}

/// All modules of some crates.
#[derive(Default)]
pub(super) struct Source {
    definitions: BTreeMap<(Module, String), Definition>,
    /// By module and name, the path that a `use` gives the name.
    uses: BTreeMap<(Module, String), Vec<String>>,
    modules: Vec<Module>,
    texts: Vec<String>,
}

impl Source {
    /// Reads the crates (name and folder) below `root`.
    pub(super) fn read(root: &Path, crates: &[(&str, &str)]) -> Self {
        let mut source = Self::default();
        for (name, folder) in crates {
            source.folder(&root.join(folder), &vec![(*name).to_owned()]);
        }
        source
    }

    fn folder(&mut self, folder: &Path, module: &Module) {
        let entries = fs::read_dir(folder).expect("a folder of sources");
        for entry in entries {
            let path = entry.expect("an entry").path();
            let stem = path.file_stem().and_then(|stem| stem.to_str());
            let stem = stem.expect("a name").to_owned();
            let inner = || [module.as_slice(), std::slice::from_ref(&stem)].concat();
            if path.is_dir() {
                self.folder(&path, &inner());
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                let own = match stem.as_str() {
                    "lib" | "main" | "mod" => module.clone(),
                    _ => inner(),
                };
                let text = fs::read_to_string(&path).expect("a source");
                let file = syn::parse_file(&text).expect("Rust");
                self.items(&file.items, &own);
                self.modules.push(own);
                self.texts.push(text);
            }
        }
    }

    fn items(&mut self, items: &[Item], module: &Module) {
        for item in items {
            match item {
                Item::Struct(item) if serializes(&item.attrs) => {
                    let shape = match &item.fields {
                        Fields::Unnamed(fields) if fields.unnamed.len() == 1 => {
                            Shape::Wrapper(fields.unnamed[0].ty.clone())
                        }
                        fields => Shape::Struct(named(fields, &item.attrs)),
                    };
                    self.define(module, &item.ident.to_string(), &item.attrs, shape);
                }
                Item::Enum(item) if serializes(&item.attrs) => {
                    let variants = item.variants.iter().map(|variant| Variant {
                        name: word(&variant.attrs, "rename")
                            .unwrap_or_else(|| renamed(&variant.ident.to_string(), &item.attrs)),
                        doc: doc(&variant.attrs),
                        fields: named(&variant.fields, &variant.attrs),
                    });
                    let shape = Shape::Enum(variants.collect());
                    self.define(module, &item.ident.to_string(), &item.attrs, shape);
                }
                Item::Use(item) => self.tree(&item.tree, &mut Vec::new(), module),
                _ => {}
            }
        }
    }

    fn define(&mut self, module: &Module, name: &str, attributes: &[Attribute], shape: Shape) {
        let definition = Definition {
            module: module.clone(),
            name: name.to_owned(),
            doc: doc(attributes),
            shape,
            tag: word(attributes, "tag"),
        };
        self.definitions
            .insert((module.clone(), name.to_owned()), definition);
    }

    fn tree(&mut self, tree: &UseTree, path: &mut Vec<String>, module: &Module) {
        match tree {
            UseTree::Path(part) => {
                path.push(part.ident.to_string());
                self.tree(&part.tree, path, module);
                path.pop();
            }
            UseTree::Name(name) => {
                let name = name.ident.to_string();
                // `use a::b::{self}` names `b`.
                let (known, whole) = match name.as_str() {
                    "self" => (path.last().cloned(), path.clone()),
                    _ => (Some(name.clone()), [path.as_slice(), &[name]].concat()),
                };
                if let Some(known) = known {
                    self.uses.insert((module.clone(), known), whole);
                }
            }
            UseTree::Rename(name) => {
                let whole = [path.as_slice(), &[name.ident.to_string()]].concat();
                self.uses
                    .insert((module.clone(), name.rename.to_string()), whole);
            }
            UseTree::Group(group) => {
                for tree in &group.items {
                    self.tree(tree, path, module);
                }
            }
            UseTree::Glob(_) => {}
        }
    }

    /// Whether the sources have a string of this text.
    pub(super) fn has_string(&self, text: &str) -> bool {
        let quoted = format!("{text:?}");
        self.texts.iter().any(|source| source.contains(&quoted))
    }

    /// The schemas that the sources name, such as `palpate.run/4`.
    pub(super) fn schemas(&self) -> BTreeSet<&str> {
        let words = self.texts.iter().flat_map(|text| text.split('"'));
        let schemas = words.filter(|word| {
            let parts = word.strip_prefix("palpate.").unwrap_or_default();
            parts.split_once('/').is_some_and(|(name, number)| {
                name.bytes().all(|byte| byte.is_ascii_lowercase()) && number.parse::<u32>().is_ok()
            })
        });
        schemas.collect()
    }

    /// The type that `path` means in `module`.
    pub(super) fn find(&self, module: &Module, path: &[String]) -> Option<&Definition> {
        self.search(module, path, 0)
    }

    fn search(&self, module: &Module, path: &[String], depth: usize) -> Option<&Definition> {
        let (first, rest) = path.split_first()?;
        if depth > 20 {
            return None;
        }
        let parent = || module[..module.len().saturating_sub(1)].to_vec();
        match first.as_str() {
            "crate" => return self.search(&module[..1].to_vec(), rest, depth + 1),
            "self" => return self.search(module, rest, depth + 1),
            "super" => return self.search(&parent(), rest, depth + 1),
            _ => {}
        }
        if rest.is_empty()
            && let Some(found) = self.definitions.get(&(module.clone(), first.clone()))
        {
            return Some(found);
        }
        // A function may have the name of its module.
        let inner = [module.as_slice(), std::slice::from_ref(first)].concat();
        if !rest.is_empty() && self.modules.contains(&inner) {
            return self.search(&inner, rest, depth + 1);
        }
        if let Some(used) = self.uses.get(&(module.clone(), first.clone())) {
            let whole = [used.as_slice(), rest].concat();
            // A path that begins with its own name is one from a crate.
            let from_crate = || self.search(&Module::new(), &whole, depth + 1);
            return self.search(module, &whole, depth + 1).or_else(from_crate);
        }
        None
    }
}

fn serializes(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let Meta::List(list) = &attribute.meta else {
            return false;
        };
        list.path.is_ident("derive") && list.tokens.to_string().contains("Serialize")
    })
}

/// The fields of a struct or a variant, without those that are skipped.
fn named(fields: &Fields, container: &[Attribute]) -> Vec<Field> {
    let fields = fields.iter().filter(|field| !flag(&field.attrs, "skip"));
    fields
        .map(|field| {
            let own = field.ident.as_ref().map(ToString::to_string);
            Field {
                name: word(&field.attrs, "rename")
                    .unwrap_or_else(|| renamed(&own.unwrap_or_default(), container)),
                doc: doc(&field.attrs),
                ty: field.ty.clone(),
                flat: flag(&field.attrs, "flatten"),
                may_miss: word(&field.attrs, "skip_serializing_if").is_some(),
            }
        })
        .collect()
}

/// A name as `rename_all` writes it.
fn renamed(name: &str, container: &[Attribute]) -> String {
    match word(container, "rename_all").as_deref() {
        Some("lowercase") => name.to_lowercase(),
        Some(style @ ("snake_case" | "kebab-case")) => {
            let between = if style == "snake_case" { '_' } else { '-' };
            let mut text = String::new();
            for (place, c) in name.chars().enumerate() {
                if c.is_uppercase() && place > 0 {
                    text.push(between);
                }
                text.extend(c.to_lowercase());
            }
            text
        }
        Some(other) => panic!("rename_all = {other:?}: add this style to json_page/source.rs"),
        None => name.to_owned(),
    }
}

/// The doc comment in one paragraph.
fn doc(attributes: &[Attribute]) -> String {
    let lines = attributes.iter().filter_map(|attribute| {
        let Meta::NameValue(pair) = &attribute.meta else {
            return None;
        };
        match &pair.value {
            Expr::Lit(literal) if pair.path.is_ident("doc") => match &literal.lit {
                Lit::Str(text) => Some(text.value().trim().to_owned()),
                _ => None,
            },
            _ => None,
        }
    });
    // The text up to an empty line says what the value is.
    let lines = lines.take_while(|line| !line.is_empty());
    lines.collect::<Vec<_>>().join(" ")
}

/// The value of `#[serde(key = "value")]`.
fn word(attributes: &[Attribute], key: &str) -> Option<String> {
    let mut found = None;
    each_serde(attributes, |name, value| {
        if name == key {
            found = value;
        }
    });
    found
}

/// Whether there is `#[serde(key)]`.
fn flag(attributes: &[Attribute], key: &str) -> bool {
    let mut found = false;
    each_serde(attributes, |name, value| {
        found |= name == key && value.is_none();
    });
    found
}

fn each_serde(attributes: &[Attribute], mut take: impl FnMut(String, Option<String>)) {
    for attribute in attributes {
        if !attribute.path().is_ident("serde") {
            continue;
        }
        let parsed = attribute.parse_nested_meta(|meta| {
            let name = meta.path.get_ident().map(ToString::to_string);
            let value = match meta.value() {
                Ok(value) => Some(value.parse::<syn::LitStr>()?.value()),
                Err(_) => None,
            };
            take(name.unwrap_or_default(), value);
            Ok(())
        });
        parsed.expect("an attribute of serde that json_page/source.rs can read");
    }
}

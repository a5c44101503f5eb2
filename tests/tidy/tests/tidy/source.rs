//! Items of the source by name, as rustfmt lays them out.

use std::collections::BTreeMap;

use crate::tree::{File, files, root};

/// The modules of one package by their path: `tandem_gcode::interpreter`.
pub struct Modules(BTreeMap<String, File>);

impl Modules {
    /// All modules of the workspace's libraries and of the command.
    pub fn read() -> Self {
        let mut modules = BTreeMap::new();
        for file in files(&[".rs"]) {
            if let Some((folder, inside)) = file.name.split_once("/src/") {
                modules.insert(module(&package(folder), inside), file);
            }
        }
        Self(modules)
    }

    /// Whether `path` is an item: `package::module::function`, `package::module::Type` or
    /// `package::module::Type::function`.
    pub fn has(&self, path: &str) -> bool {
        let (parent, name) = path.rsplit_once("::").unwrap_or(("", path));
        if let Some(file) = self.0.get(parent) {
            return defines(&file.text, name);
        }
        let (module, owner) = parent.rsplit_once("::").unwrap_or(("", parent));
        self.0
            .get(module)
            .is_some_and(|file| has_method(&file.text, owner, name))
    }
}

/// The name by which code calls a package.
fn package(folder: &str) -> String {
    let manifest =
        std::fs::read_to_string(root().join(folder).join("Cargo.toml")).unwrap_or_default();
    let name = manifest
        .lines()
        .find_map(|line| line.strip_prefix("name = \""))
        .unwrap_or_default();
    name.trim_end_matches('"').replace('-', "_")
}

fn module(package: &str, inside: &str) -> String {
    let path = inside.trim_end_matches(".rs").trim_end_matches("/mod");
    match path {
        "lib" | "main" => package.to_string(),
        path => format!("{package}::{}", path.replace('/', "::")),
    }
}

/// Whether the text holds a free function or a type called `name`.
fn defines(text: &str, name: &str) -> bool {
    let kinds = ["fn", "struct", "enum", "trait", "type", "const", "static"];
    text.lines()
        .filter(|line| !line.starts_with(' '))
        .any(|line| kinds.iter().any(|kind| names(line, kind, name)))
}

/// Whether the text holds a method `name` in an `impl` or `trait` of `owner`.
fn has_method(text: &str, owner: &str, name: &str) -> bool {
    let mut inside = false;
    for line in text.lines() {
        if !line.starts_with(' ') && !line.is_empty() && !line.starts_with('}') {
            inside = names(line, "trait", owner) || implements(line, owner);
        }
        let depth = line.len() - line.trim_start().len();
        // What a macro makes of another method is declared within the macro's braces: `fn name = other, …`.
        let is_declared = depth == 8 && line.contains(&format!("fn {name} = "));
        if inside && (depth == 4 && names(line, "fn", name) || is_declared) {
            return true;
        }
    }
    false
}

/// Whether a line is the head of an `impl` of `owner`, with or without a trait.
fn implements(line: &str, owner: &str) -> bool {
    let Some(head) = line.strip_prefix("impl") else {
        return false;
    };
    let subject = head
        .split_once(" for ")
        .map_or_else(|| without_generics(head), |(_, subject)| subject);
    word(subject.trim_start()) == owner
}

/// What follows a list of generic parameters.
fn without_generics(text: &str) -> &str {
    let mut depth = 0;
    for (index, character) in text.char_indices() {
        match character {
            '<' => depth += 1,
            '>' => depth -= 1,
            _ if depth == 0 => return &text[index..],
            _ => {}
        }
    }
    ""
}

/// Whether a line declares `kind name`.
fn names(line: &str, kind: &str, name: &str) -> bool {
    let mut words = line.split_whitespace();
    words.by_ref().any(|w| w == kind) && words.next().is_some_and(|rest| word(rest) == name)
}

fn word(text: &str) -> &str {
    let end = text
        .find(|c: char| !c.is_alphanumeric() && c != '_')
        .unwrap_or(text.len());
    &text[..end]
}

#[test]
fn items_are_found() {
    let text = [
        "pub fn free(a: u8) {}\nstruct One;\nimpl One {\n    fn own(&self) {}\n}\n",
        "impl<'a> Pump<'a> {\n    fn given() {}\n}\nimpl<'a> Two for Pump<'a> {\n    fn taken() {}\n}\n",
        "pub trait Three: Send {\n    fn asked(&mut self);\n}\n",
    ];
    let text = text.concat();
    let text = text.as_str();
    assert!(
        defines(text, "free")
            && defines(text, "One")
            && !defines(text, "own")
            && !defines(text, "fre")
    );
    assert!(
        has_method(text, "One", "own")
            && has_method(text, "Pump", "taken")
            && has_method(text, "Three", "asked")
    );
    assert!(has_method(text, "Pump", "given"));
    assert!(
        !has_method(text, "Two", "own")
            && !has_method(text, "One", "taken")
            && !has_method(text, "One", "free")
    );
    assert_eq!(
        module("tandem_recorder", "record/mod.rs"),
        "tandem_recorder::record"
    );
}

//! Mistakes in a configuration file, all of them in one go.

use std::{fmt, ops::Range};

use fencepost_core::error::{ConfigError, ConfigProblem};
use serde::de::DeserializeOwned;
use toml::{
    Spanned,
    de::{DeTable, DeValue, ValueDeserializer},
};

/// How like a known name an unknown one must be to be taken for a slip of the pen (Jaro-Winkler).
const LIKENESS: f64 = 0.8;

/// One thing that is wrong in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// Line, from 1; `None` where the thing is not in the file.
    pub line: Option<usize>,
    /// Path of the setting; empty where the text itself is wrong.
    pub field: String,
    /// What is wrong.
    pub problem: String,
    /// What to do.
    pub mend: String,
}

/// Reads a file section by section and setting by setting, so that one mistake does not hide the others.
#[derive(Debug)]
pub(super) struct Reader<'a> {
    text: &'a str,
    pub(super) mistakes: Vec<Mistake>,
}

/// A section of a file: its name, where it begins, and its settings.
#[derive(Clone, Debug)]
pub(super) struct Section<'i> {
    pub(super) path: String,
    pub(super) span: Range<usize>,
    pub(super) table: DeTable<'i>,
}

/// A setting that cannot be used, as a check says it.
pub(super) struct Refused {
    pub(super) field: String,
    pub(super) problem: String,
    pub(super) mend: String,
}

impl<'a> Reader<'a> {
    pub(super) const fn new(text: &'a str) -> Self {
        Self { text, mistakes: Vec::new() }
    }

    /// The sections of the file. Where the text is no TOML, everything that is wrong with it is noted.
    pub(super) fn root(&mut self) -> Section<'a> {
        let (root, errors) = DeTable::parse_recoverable(self.text);
        for error in errors {
            let line = error.span().map(|span| self.line(&span));
            self.note(line, "", error.message().trim(), "write it as TOML: `name = value` below a `[section]`");
        }
        Section { path: String::new(), span: root.span(), table: root.into_inner() }
    }

    /// Takes the sections `names` out of `from`; what is left is unknown.
    pub(super) fn only(&mut self, from: &Section<'a>, names: &[&str]) {
        for key in from.table.keys().filter(|key| !names.contains(&key.get_ref().as_ref())) {
            let name = key.get_ref().as_ref();
            let like = names.iter().map(|known| (strsim::jaro_winkler(name, known), *known));
            let like = like.filter(|(likeness, _)| *likeness >= LIKENESS).max_by(|a, b| a.0.total_cmp(&b.0));
            let mend = match like {
                Some((_, known)) => format!("write `{known}`"),
                None => format!("take it out, or choose from {}", names.join(", ")),
            };
            let line = self.line(&key.span());
            self.note(Some(line), &from.under(name), "is not known", mend);
        }
    }

    /// The section `name` of `from`, if it is there.
    pub(super) fn section(&mut self, from: &Section<'a>, name: &str) -> Option<Section<'a>> {
        let (key, value) = from.table.iter().find(|(key, _)| key.get_ref().as_ref() == name)?;
        let path = from.under(name);
        match value.get_ref() {
            DeValue::Table(table) => Some(Section { path, span: key.span(), table: table.clone() }),
            _ => {
                let line = self.line(&key.span());
                let header = path.clone();
                self.note(Some(line), &path, "is not a section", format!("write [{header}] and its settings below it"));
                None
            }
        }
    }

    /// The sections `[[name]]` of `from`.
    pub(super) fn sections(&mut self, from: &Section<'a>, name: &str) -> Vec<Section<'a>> {
        let Some((key, value)) = from.table.iter().find(|(key, _)| key.get_ref().as_ref() == name) else {
            return Vec::new();
        };
        let tables = match value.get_ref() {
            DeValue::Array(array) => array.iter().map(|item| match item.get_ref() {
                DeValue::Table(table) => Some((item.span(), table.clone())),
                _ => None,
            }),
            _ => {
                let line = self.line(&key.span());
                self.note(
                    Some(line),
                    name,
                    "is not a list of sections",
                    format!("write [[{name}]], with two brackets"),
                );
                return Vec::new();
            }
        };
        let tables: Option<Vec<_>> = tables.collect();
        let Some(tables) = tables else {
            let line = self.line(&key.span());
            self.note(Some(line), name, "holds something that is no section", format!("write [[{name}]] for each"));
            return Vec::new();
        };
        let path = |index| if tables.len() == 1 { name.to_string() } else { format!("{name}[{index}]") };
        let numbered = tables.iter().cloned().enumerate();
        numbered.map(|(index, (span, table))| Section { path: path(index), span, table }).collect()
    }

    /// Reads the settings of a section one by one, then together; `fill` are settings that must be there, with values in TOML
    /// that stand in for them while the others are read. `check` says what of the values cannot be used.
    pub(super) fn settings<T: DeserializeOwned>(
        &mut self,
        section: &Section<'a>,
        fill: &[(&str, &'static str)],
        check: impl Fn(&T) -> Vec<Refused>,
    ) -> Option<T> {
        let filled = |table: &DeTable<'a>| {
            let mut table = table.clone();
            for (name, value) in fill {
                let there = table.keys().any(|key| key.get_ref().as_ref() == *name);
                if let Some(value) = DeValue::parse(value).ok().filter(|_| !there) {
                    table.insert(Spanned::new(0..0, (*name).into()), value);
                }
            }
            table
        };
        let before = self.mistakes.len();
        let mut good = DeTable::new();
        for (key, value) in &section.table {
            let mut alone = DeTable::new();
            alone.insert(key.clone(), value.clone());
            match read::<T>(filled(&alone), &section.span) {
                Ok(_) => {
                    good.insert(key.clone(), value.clone());
                }
                Err(error) => {
                    let span = error.span().filter(|span| span.start > 0).unwrap_or_else(|| value.span());
                    let line = self.line(&span);
                    let (problem, mend) = in_words(error.message(), key.get_ref().as_ref());
                    self.note(Some(line), &section.under(key.get_ref().as_ref()), problem, mend);
                }
            }
        }
        for (name, _) in fill {
            if !section.table.keys().any(|key| key.get_ref().as_ref() == *name) {
                let line = self.line(&section.span);
                self.note(Some(line), &section.under(name), "is missing", "give it a value");
            }
        }
        // Whatever is left can be read; a check that refuses a value is asked again without it, until it has no more to say.
        loop {
            let value = read::<T>(filled(&good), &section.span).ok()?;
            let refused = check(&value);
            let mut found = false;
            for Refused { field, problem, mend } in refused {
                let span = good.iter().find(|(key, _)| key.get_ref().as_ref() == first(&field)).map(|(key, value)| {
                    // An inline value stands on the line of its name.
                    if value.span().start == 0 { key.span() } else { value.span() }
                });
                found |= span.is_some();
                let line = self.line(&span.unwrap_or_else(|| section.span.clone()));
                self.note(Some(line), &section.under(&field), problem, mend);
                good = good.into_iter().filter(|(key, _)| key.get_ref().as_ref() != first(&field)).collect();
            }
            if !found {
                return (self.mistakes.len() == before).then_some(value);
            }
        }
    }

    /// Notes a mistake.
    pub(super) fn note(
        &mut self,
        line: Option<usize>,
        field: &str,
        problem: impl Into<String>,
        mend: impl Into<String>,
    ) {
        let mistake = Mistake { line, field: field.into(), problem: problem.into(), mend: mend.into() };
        // A check is asked again without what it refused, and may say once more what has nothing to do with that.
        if !self.mistakes.contains(&mistake) {
            self.mistakes.push(mistake);
        }
    }

    /// Notes a mistake of a setting of `section`, at its line if it is there.
    pub(super) fn note_at(
        &mut self,
        section: &Section<'_>,
        field: &str,
        problem: impl Into<String>,
        mend: impl Into<String>,
    ) {
        let line = self.line(&section.span_of(field));
        self.note(Some(line), &section.under(field), problem, mend);
    }

    pub(super) fn line(&self, span: &Range<usize>) -> usize {
        1 + self.text.bytes().take(span.start).filter(|byte| *byte == b'\n').count()
    }
}

impl<'a> Section<'a> {
    /// The settings `names` of the section by themselves.
    pub(super) fn plain(&self, names: &[&str]) -> Section<'a> {
        let table = self.table.clone().into_iter().filter(|(key, _)| names.contains(&key.get_ref().as_ref())).collect();
        Section { table, ..self.clone() }
    }

    pub(super) fn under(&self, name: &str) -> String {
        match (self.path.as_str(), name) {
            ("", name) => name.to_string(),
            (path, "") => path.to_string(),
            (path, name) => format!("{path}.{name}"),
        }
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.table.keys().any(|key| key.get_ref().as_ref() == name)
    }

    fn span_of(&self, field: &str) -> Range<usize> {
        let key = self.table.keys().find(|key| key.get_ref().as_ref() == first(field));
        key.map_or_else(|| self.span.clone(), Spanned::span)
    }
}

impl Refused {
    /// From a check of the core, whose fields are named `section.setting`.
    pub(super) fn of(error: ConfigError) -> Self {
        let field = error.field.split_once('.').map_or(error.field, |(_, field)| field);
        let mend = match error.problem {
            ConfigProblem::OutOfRange { min, max } => format!("set it to {min} or more, {max} at most"),
            ConfigProblem::OverCapacity { capacity, .. } => format!("set it to {capacity} or less"),
            ConfigProblem::NotOdd => "set it to an odd number".to_string(),
            ConfigProblem::NotAMultiple { of } => format!("set it to a multiple of {of}"),
            ConfigProblem::SameDetector => "name another detector, or leave it out".to_string(),
            _ => "correct it".to_string(),
        };
        Self { field: field.to_string(), problem: error.problem.to_string(), mend }
    }
}

fn first(field: &str) -> &str {
    field.split('.').next().unwrap_or(field)
}

fn read<T: DeserializeOwned>(table: DeTable<'_>, span: &Range<usize>) -> Result<T, toml::de::Error> {
    T::deserialize(ValueDeserializer::from(Spanned::new(span.clone(), DeValue::Table(table))))
}

/// What a library says of a value, in the words of this program.
fn in_words(message: &str, name: &str) -> (String, String) {
    let message = message.trim().replace('\n', ", ");
    let Some(rest) = message.strip_prefix("unknown field ") else {
        return (message, "compare it with docs/files.md".to_string());
    };
    // unknown field `windov`, expected one of `a`, `b`
    let mut quoted = rest.split('`').skip(1).step_by(2);
    let unknown = quoted.next().unwrap_or(name).to_string();
    let known: Vec<&str> = quoted.collect();
    let like = known.iter().map(|known| (strsim::jaro_winkler(&unknown, known), *known));
    let like = like.filter(|(likeness, _)| *likeness >= LIKENESS).max_by(|a, b| a.0.total_cmp(&b.0));
    let mend = match like {
        Some((_, known)) => format!("write `{known}`"),
        None => format!("take it out, or choose from {}", known.join(", ")),
    };
    let problem = if unknown == name { "is not known".to_string() } else { format!("`{unknown}` is not known") };
    (problem, mend)
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { line, field, problem, mend } = self;
        if let Some(line) = line {
            write!(f, "line {line}: ")?;
        }
        if !field.is_empty() {
            write!(f, "{field} ")?;
        }
        write!(f, "{problem}\n  mend:  {mend}")
    }
}

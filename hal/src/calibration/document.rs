//! YAML and XML as one plain tree, with the line of everything in it.

use std::path::Path;

use saphyr_parser::{Event, Parser};

use super::error::{CalibrationError, CalibrationProblem};

/// Deepest nesting that is read: calibrations need four levels.
const MAX_DEPTH: usize = 16;

/// A value of a document.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Node {
    Scalar(String),
    List(Vec<Node>),
    Map(Vec<(String, Node)>),
}

/// A document and the file it comes from, for the errors.
pub(super) struct Document<'a> {
    pub(super) file: &'a Path,
    pub(super) root: Node,
}

impl Node {
    /// Reads YAML; OpenCV's `%YAML:1.0` line and its matrix tags are allowed for.
    ///
    /// # Errors
    /// Line and message.
    pub(super) fn from_yaml(text: &str) -> Result<Self, (usize, String)> {
        // OpenCV and EuRoC begin with `%YAML:1.0`, which no YAML standard allows. The line is kept, empty, for the line
        // numbers, and so is what follows.
        let mut owned = String::with_capacity(text.len());
        for line in text.trim_start_matches('\u{feff}').lines() {
            if !line.starts_with("%YAML") {
                owned.push_str(line);
            }
            owned.push('\n');
        }
        let mut stack: Vec<Open> = Vec::new();
        let mut root = None;
        for event in Parser::new_from_str(&owned) {
            let (event, span) = event.map_err(|e| (e.marker().line(), e.info().to_owned()))?;
            let line = span.start.line();
            let done = match event {
                Event::Scalar(text, ..) => Some(Self::Scalar(text.into_owned())),
                Event::SequenceStart(..) => {
                    stack.push(Open::List(Vec::new()));
                    None
                }
                Event::MappingStart(..) => {
                    stack.push(Open::Map(Vec::new(), None));
                    None
                }
                Event::SequenceEnd | Event::MappingEnd => match stack.pop() {
                    Some(Open::List(list)) => Some(Self::List(list)),
                    Some(Open::Map(map, _)) => Some(Self::Map(map)),
                    None => None,
                },
                // An alias can make a small file unfold without end, and no calibration tool writes one.
                Event::Alias(_) => return Err((line, "aliases are not read".to_owned())),
                _ => None,
            };
            if stack.len() > MAX_DEPTH {
                return Err((line, "nested too deep".to_owned()));
            }
            let Some(node) = done else { continue };
            match stack.last_mut() {
                Some(Open::List(list)) => list.push(node),
                Some(Open::Map(map, key)) => match (key.take(), node) {
                    (Some(key), node) => map.push((key, node)),
                    (None, Self::Scalar(text)) => *key = Some(text),
                    (None, _) => return Err((line, "a key must be a word".to_owned())),
                },
                None => {
                    root.get_or_insert(node);
                }
            }
        }
        root.ok_or((1, "the file is empty".to_owned()))
    }

    /// Reads XML as OpenCV writes it: `<opencv_storage>` with an element for each key.
    ///
    /// # Errors
    /// Line and message.
    pub(super) fn from_xml(text: &str) -> Result<Self, (usize, String)> {
        let document = roxmltree::Document::parse(text).map_err(|e| (e.pos().row as usize, e.to_string()))?;
        from_element(document.root_element(), 0).ok_or((1, "nested too deep".to_owned()))
    }

    /// The value of `key`, if this is a map that has it.
    pub(super) fn get(&self, key: &str) -> Option<&Self> {
        match self {
            Self::Map(map) => map.iter().find(|(name, _)| name == key).map(|(_, node)| node),
            _ => None,
        }
    }

    /// The text, if this is a scalar.
    pub(super) fn text(&self) -> Option<&str> {
        match self {
            Self::Scalar(text) => Some(text.trim()),
            _ => None,
        }
    }

    /// Every number below this node in the order of the file: lists, lists of lists, and text with numbers between spaces.
    fn numbers(&self, into: &mut Vec<f64>) -> Result<(), CalibrationProblem> {
        match self {
            Self::Scalar(text) => {
                for word in text.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty()) {
                    into.push(number(word)?);
                }
                Ok(())
            }
            Self::List(list) => list.iter().try_for_each(|node| node.numbers(into)),
            Self::Map(_) => Err(CalibrationProblem::Shape { wanted: "numbers", found: "a map".to_owned() }),
        }
    }
}

/// A finite number, in any of the spellings of YAML and C.
pub(super) fn number(word: &str) -> Result<f64, CalibrationProblem> {
    let plain = match word.to_ascii_lowercase().as_str() {
        ".nan" | "-.nan" | ".inf" | "+.inf" | "-.inf" => return Err(CalibrationProblem::NotFinite),
        _ => word.parse::<f64>(),
    };
    match plain {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(CalibrationProblem::NotFinite),
        Err(_) => Err(CalibrationProblem::NotANumber(word.chars().take(40).collect())),
    }
}

impl Document<'_> {
    /// An error about `field` of this file.
    pub(super) fn error(&self, field: &str, problem: CalibrationProblem) -> CalibrationError {
        CalibrationError::new(self.file, field, problem)
    }

    /// The first of `keys` that is there, with its name.
    pub(super) fn find<'k>(&self, keys: &[&'k str]) -> Option<(&'k str, &Node)> {
        keys.iter().find_map(|key| self.root.get(key).map(|node| (*key, node)))
    }

    /// As [`Self::find`].
    ///
    /// # Errors
    /// Names the first of `keys` if none is there.
    pub(super) fn need<'k>(&self, keys: &[&'k str]) -> Result<(&'k str, &Node), CalibrationError> {
        let first = keys.first().copied().unwrap_or_default();
        self.find(keys).ok_or_else(|| self.error(first, CalibrationProblem::Missing))
    }

    /// The numbers of a list, or of a matrix given as `rows`, `cols` and `data`.
    pub(super) fn numbers(&self, field: &str, node: &Node) -> Result<Vec<f64>, CalibrationError> {
        let mut values = Vec::new();
        let data = match node {
            Node::Map(_) => {
                node.get("data").ok_or_else(|| self.error(&format!("{field}.data"), CalibrationProblem::Missing))?
            }
            _ => node,
        };
        data.numbers(&mut values).map_err(|problem| self.error(field, problem))?;
        if let (Some(rows), Some(cols)) = (node.get("rows").and_then(count), node.get("cols").and_then(count))
            && rows.checked_mul(cols) != Some(values.len())
        {
            let found = format!("{} values for {rows} x {cols}", values.len());
            return Err(self.error(field, CalibrationProblem::Shape { wanted: "rows x cols values", found }));
        }
        Ok(values)
    }

    /// Exactly `N` numbers; `wanted` is the shape in words. A matrix that says another shape than `shape` is refused.
    pub(super) fn array<const N: usize>(
        &self,
        field: &str,
        node: &Node,
        shape: (usize, usize),
        wanted: &'static str,
    ) -> Result<[f64; N], CalibrationError> {
        let values = self.numbers(field, node)?;
        if let (Some(rows), Some(cols)) = (node.get("rows").and_then(count), node.get("cols").and_then(count)) {
            // A vector may lie or stand.
            let vector = shape.0.min(shape.1) == 1 && (cols, rows) == shape;
            if (rows, cols) != shape && !vector {
                return Err(self.error(field, CalibrationProblem::Shape { wanted, found: format!("{rows} x {cols}") }));
            }
        }
        let found = values.len();
        values
            .try_into()
            .map_err(|_| self.error(field, CalibrationProblem::Shape { wanted, found: format!("{found} values") }))
    }

    /// One number.
    pub(super) fn scalar(&self, field: &str, node: &Node) -> Result<f64, CalibrationError> {
        self.array::<1>(field, node, (1, 1), "one number").map(|[value]| value)
    }
}

/// A container whose end has not come yet.
enum Open {
    List(Vec<Node>),
    Map(Vec<(String, Node)>, Option<String>),
}

fn count(node: &Node) -> Option<usize> {
    node.text()?.parse().ok()
}

fn from_element(element: roxmltree::Node<'_, '_>, depth: usize) -> Option<Node> {
    if depth > MAX_DEPTH {
        return None;
    }
    let mut children = Vec::new();
    for child in element.children().filter(roxmltree::Node::is_element) {
        children.push((child.tag_name().name().to_owned(), from_element(child, depth + 1)?));
    }
    if children.is_empty() {
        return Some(Node::Scalar(element.text().unwrap_or_default().to_owned()));
    }
    // OpenCV calls the elements of a list `_`.
    if children.iter().all(|(name, _)| name == "_") {
        return Some(Node::List(children.into_iter().map(|(_, node)| node).collect()));
    }
    Some(Node::Map(children))
}

//! The XML syntax, read as a stream: data that are not needed take no memory.

use quick_xml::{
    Reader, XmlVersion,
    escape::resolve_predefined_entity,
    events::{BytesStart, Event},
};

use super::{
    ImportError,
    model::{Attribute, Component, LoadCase, Model, Relation, Value},
    read::{COMPONENTS, LONGEST, RELATIONS, decoded, is_read, unreadable},
};

/// Largest depth of nested elements; the format has eight.
const DEEPEST: usize = 64;

/// Reads the XML syntax.
pub(super) fn read(text: &str) -> Result<Model, ImportError> {
    let mut reader = Reader::from_str(text);
    let mut file = File::default();
    loop {
        let at = reader.buffer_position();
        let event = match reader.read_event() {
            Ok(event) => event,
            Err(error) => return fault(text, reader.error_position(), &error.to_string()),
        };
        let done = match event {
            Event::Start(element) => file.open(&element),
            Event::Empty(element) => file.open(&element).and_then(|()| file.close()),
            Event::End(_) => file.close(),
            Event::Text(words) => file.words(&words.xml10_content()),
            Event::CData(words) => file.words(&words),
            Event::GeneralRef(name) => file.entity(&name, name.resolve_char_ref().ok().flatten()),
            Event::DocType(_) => Err("a document type; files with one are refused".to_owned()),
            Event::Eof => break,
            Event::Comment(_) | Event::Decl(_) | Event::PI(_) => Ok(()),
        };
        if let Err(words) = done {
            return fault(text, at, &words);
        }
    }
    match file.path.last() {
        Some(open) => fault(text, text.len() as u64, &format!("the file ends inside <{open}>")),
        None if !file.has_model => unreadable("no element <model>: this is no file of the format REXS"),
        None => Ok(file.model),
    }
}

fn fault<T>(text: &str, at: u64, words: &str) -> Result<T, ImportError> {
    let at = usize::try_from(at).unwrap_or(usize::MAX).min(text.len());
    let before = &text.as_bytes()[..at];
    let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
    let column = 1 + before.iter().rev().take_while(|byte| **byte != b'\n').count();
    unreadable(format!("line {line}, column {column}: {words}"))
}

/// Content read so far, and the elements that are open.
#[derive(Default)]
struct File {
    model: Model,
    has_model: bool,
    path: Vec<String>,
    case: Option<LoadCase>,
    component: Option<Component>,
    relation: Option<Relation>,
    attribute: Option<(String, String)>,
    /// Code of an array in base64.
    code: String,
    items: Option<Vec<String>>,
    text: String,
}

impl File {
    fn open(&mut self, element: &BytesStart<'_>) -> Result<(), String> {
        let name = element.local_name().into_inner().to_owned();
        let mut keys = Vec::new();
        for attribute in element.attributes().with_checks(false) {
            let attribute = attribute.map_err(|error| error.to_string())?;
            let key = attribute.key.local_name().into_inner();
            if ["id", "type", "name", "unit", "role", "code", "version", "applicationId"].contains(&key) {
                let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|error| error.to_string())?;
                keys.push((key.to_owned(), value.into_owned()));
            }
        }
        let key = |name: &str| {
            keys.iter().find(|(key, _)| key == name).map(|(_, value)| value.trim().to_owned()).unwrap_or_default()
        };
        if self.path.len() >= DEEPEST {
            return Err(format!("more than {DEEPEST} elements inside each other"));
        }
        match name.as_str() {
            "model" => {
                self.has_model = true;
                (self.model.version, self.model.application) = (key("version"), key("applicationId"));
            }
            "load_case" => self.case = Some(LoadCase { id: key("id"), components: Vec::new() }),
            "component" => {
                if key("id").is_empty() {
                    return Err("a component without an id".to_owned());
                }
                let (id, kind, name) = (key("id"), key("type"), key("name"));
                self.component = Some(Component { id, kind, name, ..Component::default() });
            }
            "relation" => self.relation = Some(Relation { kind: key("type"), refs: Vec::new() }),
            "ref" => {
                if let Some(relation) = self.relation.as_mut().filter(|relation| relation.refs.len() < LONGEST) {
                    relation.refs.push((key("role"), key("id")));
                }
            }
            "attribute" => {
                self.text.clear();
                self.attribute = Some((key("id"), key("unit"))).filter(|(id, _)| is_read(id));
            }
            "array" => {
                self.text.clear();
                (self.code, self.items) = (key("code"), Some(Vec::new()));
            }
            "c" => self.text.clear(),
            // Two dimensions: no attribute in use has them.
            "matrix" | "array_of_arrays" => self.attribute = None,
            _ => {}
        }
        self.path.push(name);
        Ok(())
    }

    fn words(&mut self, words: &str) -> Result<(), String> {
        if self.attribute.is_some() {
            self.text.push_str(words);
        }
        Ok(())
    }

    fn entity(&mut self, name: &str, character: Option<char>) -> Result<(), String> {
        let known = character.map(String::from).or_else(|| resolve_predefined_entity(name).map(str::to_owned));
        match known {
            Some(words) => self.words(&words),
            None => Err(format!("the entity &{name}; files with their own entities are refused")),
        }
    }

    fn close(&mut self) -> Result<(), String> {
        match self.path.pop().as_deref() {
            Some("c") => {
                if let Some(items) = self.items.as_mut().filter(|items| items.len() < LONGEST) {
                    items.push(self.text.trim().to_owned());
                }
            }
            Some("attribute") => {
                let (text, items, code) = (self.text.trim(), self.items.take(), std::mem::take(&mut self.code));
                let Some((id, unit)) = self.attribute.take() else { return Ok(()) };
                let value = match items {
                    Some(_) if !code.is_empty() => {
                        Value::Numbers(decoded(&code, text).map_err(|words| format!("attribute {id}: {words}"))?)
                    }
                    Some(items) => Value::Words(items),
                    None => Value::Word(text.to_owned()),
                };
                if let Some(component) = &mut self.component {
                    component.attributes.insert(id, Attribute { unit, value });
                }
            }
            Some("component") => {
                let component = self.component.take();
                self.case.as_mut().map_or(&mut self.model.components, |case| &mut case.components).extend(component);
            }
            Some("relation") => self.model.relations.extend(self.relation.take()),
            Some("load_case") => self.model.load_cases.extend(self.case.take()),
            _ => {}
        }
        match &self.model {
            model if model.components.len() > COMPONENTS => Err(format!("more than {COMPONENTS} components")),
            model if model.relations.len() > RELATIONS => Err(format!("more than {RELATIONS} relations")),
            _ => Ok(()),
        }
    }
}

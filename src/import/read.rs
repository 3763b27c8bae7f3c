//! Reading of the bytes of a file: archives, text, and the choice between the two syntaxes.

use std::io::{Cursor, Read};

use super::{ImportError, json, model::Model, xml};

/// Largest size of a file, unpacked, bytes.
pub const LARGEST: u64 = 256 << 20;

/// Maximum number of components and relations; gearboxes with all of their bearings have some hundreds.
pub(super) const COMPONENTS: usize = 20_000;
pub(super) const RELATIONS: usize = 50_000;
/// Largest number of items that are stored of a list; no list in use has more.
pub(super) const LONGEST: usize = 1000;

/// Names of the attributes that are read, in order.
const READ: &[&str] = &[
    "addendum_coefficient_reference_profile",
    "addendum_modification",
    "addendum_modification_coefficient",
    "axial_stiffness",
    "center_distance",
    "defines_speed",
    "defines_torque",
    "density",
    "face_width",
    "helix_angle_reference_diameter",
    "inner_diameter",
    "inner_diameter_begin",
    "inner_diameter_end",
    "is_engaged",
    "length",
    "mass_of_component",
    "maximum_normal_backlash",
    "mean_mesh_stiffness_for_transverse_load_iso_6336_2019",
    "minimum_normal_backlash",
    "normal_module",
    "normal_pressure_angle",
    "number_of_teeth",
    "outer_diameter",
    "outer_diameter_begin",
    "outer_diameter_end",
    "radial_contact_ratio",
    "radial_stiffness",
    "reference_component_for_position",
    "rotating_angle_around_neg_u_axis",
    "rotational_speed",
    "rotational_stiffness",
    "support_vector",
    "tip_diameter",
    "torque_around_u_axis",
    "u_axis_vector",
    "u_coordinate_on_shaft",
    "w_axis_vector",
];

/// Returns whether an attribute is read.
pub(super) fn is_read(name: &str) -> bool {
    READ.binary_search(&name).is_ok()
}

/// Reads a file of the format: XML, JSON, or a zip archive with one of them in it.
///
/// # Errors
/// [`ImportError::Unreadable`] with the place and the cause.
pub fn read(bytes: &[u8]) -> Result<Model, ImportError> {
    let mut model = if bytes.starts_with(b"PK") { text(&unpacked(bytes)?) } else { text(bytes) }?;
    // Writers differ in the order of the same components.
    model.components.sort_by_key(|component| (component.id.parse().unwrap_or(u64::MAX), component.id.clone()));
    Ok(model)
}

/// Returns the error of an unreadable file, with these words.
pub(super) fn unreadable<T>(words: impl Into<String>) -> Result<T, ImportError> {
    Err(ImportError::Unreadable(words.into()))
}

fn text(bytes: &[u8]) -> Result<Model, ImportError> {
    if bytes.len() as u64 > LARGEST {
        return unreadable(format!("{} bytes; at most {LARGEST} are read", bytes.len()));
    }
    let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
    let latin: String;
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(_) if is_latin(bytes) => {
            latin = bytes.iter().map(|byte| char::from(*byte)).collect();
            &latin
        }
        Err(error) => return unreadable(format!("byte {}: no UTF-8 text", error.valid_up_to())),
    };
    match text.trim_start().as_bytes().first() {
        Some(b'<') => xml::read(text),
        Some(b'{') => json::read(text),
        Some(_) => unreadable("neither XML (which begins with <) nor JSON (which begins with {)"),
        None => unreadable("the file is empty"),
    }
}

/// Returns whether the declaration of an XML file names a western European encoding, in which a byte is a character.
fn is_latin(bytes: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]).to_ascii_lowercase();
    head.starts_with("<?xml") && (head.contains("iso-8859-1") || head.contains("windows-1252"))
}

/// Returns the bytes of the only gearbox file in an archive.
fn unpacked(bytes: &[u8]) -> Result<Vec<u8>, ImportError> {
    let fault = |error: zip::result::ZipError| ImportError::Unreadable(format!("zip archive: {error}"));
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).map_err(fault)?;
    let is_model = |name: &str| {
        let name = name.to_ascii_lowercase();
        let endings = [".rexs", ".rexsj", ".rexs.xml", ".rexs.json", ".xml", ".json"];
        !name.starts_with("__macosx/") && endings.iter().any(|ending| name.ends_with(ending))
    };
    let names = archive.file_names().filter_map(Result::ok).map(std::borrow::Cow::into_owned);
    let names: Vec<String> = names.filter(|name| is_model(name)).collect();
    let [name] = names.as_slice() else {
        let listed = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        return unreadable(format!("zip archive: one file that ends in .rexs or .rexsj is read; it has {listed}"));
    };
    let file = archive.by_name(name).map_err(fault)?;
    let mut unpacked = Vec::new();
    if let Err(error) = file.take(LARGEST + 1).read_to_end(&mut unpacked) {
        return unreadable(format!("zip archive: {name}: {error}"));
    }
    if unpacked.len() as u64 > LARGEST {
        return unreadable(format!("zip archive: {name}: more than {LARGEST} bytes unpacked"));
    }
    Ok(unpacked)
}

/// Decodes numbers in base64 of the type `code`: int32, float32 or float64, little-endian.
pub(super) fn decoded(code: &str, text: &str) -> Result<Vec<f64>, String> {
    use base64::{Engine, engine::general_purpose::STANDARD};
    let packed: String = text.split_whitespace().collect();
    let bytes = STANDARD.decode(packed).map_err(|error| format!("base64: {error}"))?;
    let pieces = |size: usize| {
        if bytes.len().is_multiple_of(size) {
            Ok(bytes.chunks_exact(size))
        } else {
            Err(format!("{} bytes are no whole number of {code}", bytes.len()))
        }
    };
    Ok(match code {
        "int32" => pieces(4)?.filter_map(|b| b.try_into().ok()).map(|b| f64::from(i32::from_le_bytes(b))).collect(),
        "float32" => pieces(4)?.filter_map(|b| b.try_into().ok()).map(|b| f64::from(f32::from_le_bytes(b))).collect(),
        "float64" => pieces(8)?.filter_map(|b| b.try_into().ok()).map(f64::from_le_bytes).collect(),
        _ => return Err(format!("code \"{code}\"; int32, float32 and float64 are read")),
    })
}

//! Models as TOML: the built-in ones, and those of files.

use std::ops::Range;

use toml::de::DeTable;

use super::check::ModelError;
use super::model::Model;

/// The built-in models by name, with the text of their files.
pub const MODELS: [(&str, &str); 3] = [
    ("crazyflie", include_str!("../../../../assets/vehicles/crazyflie.toml")),
    ("crazyflie-brushless", include_str!("../../../../assets/vehicles/crazyflie-brushless.toml")),
    ("hummingbird", include_str!("../../../../assets/vehicles/hummingbird.toml")),
];

/// What is wrong with the text of a model, and which of its bytes say so.
#[derive(Clone, Debug, PartialEq)]
pub struct Misread {
    /// What is wrong, in a sentence.
    pub message: String,
    /// What to do about it.
    pub help: String,
    /// The offending bytes.
    pub span: Range<usize>,
}

/// Reads and checks a model.
///
/// # Errors
/// [`Misread`] where the text is not TOML, lacks a key, has another one, or says what cannot be flown.
pub fn read(text: &str) -> Result<Model, Misread> {
    let model: Model = toml::from_str(text).map_err(|error| Misread {
        message: error.message().to_owned(),
        help: "a model has the keys of the built-in ones, which docs/vehicles.md lists".to_owned(),
        span: error.span().unwrap_or(0..0),
    })?;
    model.check().map_err(|ModelError { key, message, help }| {
        let table = DeTable::parse(text).ok();
        let span = table.and_then(|table| Some(table.get_ref().get(key)?.span())).unwrap_or(0..0);
        Misread { message, help, span }
    })?;
    Ok(model)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_model_is_right_and_has_its_name() {
        for (name, text) in MODELS {
            assert_eq!(read(text).expect("a model").name, name);
        }
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        let (_, text) = MODELS[0];
        for (before, after, said) in [
            ("mass_kg = 0.0328", "mass_kg = -1.0", "mass_kg is -1"),
            ("16.8e-6, 16.8e-6, 29.8e-6", "16.8e-6, -16.8e-6, 29.8e-6", "inertia_kg_m2 is -0.0000168"),
            ("16.8e-6, 16.8e-6, 29.8e-6", "16.8e-6, 16.8e-6, 39.8e-6", "more than the other two together"),
            ("max_thrust_n = 0.12", "max_thrust_n = 0.08", "not more than the weight of 0.321658 N"),
            ("attitude_rad_s = 6.0", "attitude_rad_s = 31.0", "2 zeta > omega tau"),
            ("\"ccw\", \"cw\", \"ccw\", \"cw\"", "\"cw\", \"cw\", \"cw\", \"cw\"", "each by itself"),
            ("lag_up_s = 0.065", "lag_up_s = nan", "lag_up_s is NaN"),
            ("ground_effect = 11", "ground_effects = 11", "unknown field `ground_effects`"),
        ] {
            let wrong = text.replace(before, after);
            assert_ne!(wrong, text, "{before}");
            let error = read(&wrong).expect_err(after);
            assert!(error.message.contains(said), "{}", error.message);
            let key = after.split(' ').next().unwrap_or_default();
            let line = &wrong[..error.span.end];
            let line = &line[line.rfind('\n').map_or(0, |end| end + 1)..];
            assert!(error.span.start > 0 && (line.contains(key) || !after.contains('=')), "{after}: {line}");
        }
    }
}

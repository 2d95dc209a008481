//! Colours and themes.

use bytemuck::{Pod, Zeroable};

use crate::picture::byte;
use tautline_report::drawing::LIMITS;
use tautline_report::drawing::colours::{LIGHTS, LINKS, QUANTITIES, ThemeColour, VEHICLES, mixed};

/// Colour in sRGB with straight alpha, 8 bits per channel.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Colour {
    /// Red, green, blue and opacity.
    pub rgba: [u8; 4],
}

impl Colour {
    /// Returns the opaque colour `0xRRGGBB`.
    #[must_use]
    pub const fn hex(rgb: u32) -> Self {
        let [_, red, green, blue] = rgb.to_be_bytes();
        Self { rgba: [red, green, blue, 255] }
    }

    /// Returns the colour with this opacity, from 0 to 1.
    #[must_use]
    pub fn at(self, opacity: f32) -> Self {
        let [red, green, blue, _] = self.rgba;
        Self { rgba: [red, green, blue, byte(opacity * 255.0)] }
    }

    /// Interpolates between two colours, opacity included; `t` is from 0 to 1.
    fn towards(self, other: Self, t: f32) -> Self {
        let mix = |k: usize| {
            let (a, b) = (f32::from(self.rgba[k]), f32::from(other.rgba[k]));
            byte(a + (b - a) * t.clamp(0.0, 1.0))
        };
        Self { rgba: [mix(0), mix(1), mix(2), mix(3)] }
    }

    /// Returns the opacity from 0 to 1.
    fn opacity(self) -> f32 {
        f32::from(self.rgba[3]) / 255.0
    }

    /// Returns linear red, green, blue from 0 to 1, and opacity (IEC 61966-2-1).
    pub(crate) fn linear(self) -> [f32; 4] {
        let light = |k: usize| {
            let c = f32::from(self.rgba[k]) / 255.0;
            if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        };
        [light(0), light(1), light(2), self.opacity()]
    }
}

/// Set of colours for a whole picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Theme {
    /// Light on nearly black, for screens.
    #[default]
    Dark,
    /// Dark on white, for pages and print.
    Light,
}

/// What the colours of vehicles and trails show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Colouring {
    /// The vehicle.
    #[default]
    Vehicle,
    /// The speed.
    Speed,
    /// The distance to the nearest vehicle, less delta.
    Clearance,
    /// The place across the swarm: vehicles are lights on a night sky, in any theme.
    Lights,
}

impl Colouring {
    /// All choices with their names.
    pub const ALL: [(&'static str, Self); 4] =
        [("vehicle", Self::Vehicle), ("speed", Self::Speed), ("clearance", Self::Clearance), ("lights", Self::Lights)];
}

impl Theme {
    /// All themes with their names.
    pub const ALL: [(&'static str, Self); 2] = [("dark", Self::Dark), ("light", Self::Light)];

    fn rgb(self, colour: ThemeColour) -> u32 {
        if self == Self::Dark { colour.dark } else { colour.light }
    }

    /// Returns the colour in this theme.
    pub(crate) fn pick(self, colour: ThemeColour) -> Colour {
        Colour::hex(self.rgb(colour))
    }

    /// Returns the colour of vehicle `k`; the colours repeat.
    pub(crate) fn vehicle(self, k: usize) -> Colour {
        self.pick(VEHICLES[k % VEHICLES.len()])
    }

    /// Returns the colour of vehicle `k` of `count`.
    pub(crate) fn vehicle_among(self, k: usize, count: usize) -> Colour {
        self.vehicle(if count <= LIMITS.colours { k } else { 0 })
    }

    /// Returns the colour of an edge: orange pushes (-1), grey is at rest (0), blue pulls (1). Colour-blind readers can
    /// tell the three apart.
    pub(crate) fn tension(self, tension: f32) -> Colour {
        let [push, rest, pull] = LINKS.map(|colour| self.pick(colour));
        rest.towards(if tension < 0.0 { push } else { pull }, tension.abs())
    }

    /// Returns the colour of a quantity relative to its range, from 0 to 1.
    pub(crate) fn ramp(self, part: f32) -> Colour {
        Colour::mixed(QUANTITIES.map(|colour| self.rgb(colour)), part)
    }
}

impl Colour {
    /// Returns the colour of a light at a part of the width of the swarm, from 0 to 1.
    pub(crate) fn light(part: f32) -> Self {
        Self::mixed(LIGHTS.map(|colour| colour.dark), part)
    }

    /// Interpolates between even colours; `part` is from 0 to 1.
    fn mixed(rgb: [u32; 4], part: f32) -> Self {
        let [red, green, blue] = mixed(&rgb, part.into());
        Self { rgba: [red, green, blue, 255] }
    }

    /// Returns the colour of a surface that receives this part of the light.
    pub(super) fn lit(self, light: f32) -> Self {
        Self::hex(0).towards(self.at(1.0), light)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use tautline_report::drawing::colours::{ALARM, GOOD, INK, OBSTACLE, PAPER, SOFT_INK};

    /// Relative luminance, WCAG 2.2.
    fn luminance(colour: Colour) -> f32 {
        let [red, green, blue, _] = colour.linear();
        0.2126 * red + 0.7152 * green + 0.0722 * blue
    }

    fn contrast(a: Colour, b: Colour) -> f32 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn text_and_verdicts_have_enough_contrast_in_every_theme() {
        for (name, theme) in Theme::ALL {
            for (what, colour, least) in [
                ("ink", theme.pick(INK), 7.0),
                ("soft ink", theme.pick(SOFT_INK), 4.5),
                ("alarm", theme.pick(ALARM), 4.5),
                ("good", theme.pick(GOOD), 4.5),
                ("pushing", theme.tension(-1.0), 3.0),
                ("pulling", theme.tension(1.0), 3.0),
                ("vehicle", theme.vehicle(0), 3.0),
                ("obstacle", theme.pick(OBSTACLE), 3.0),
                ("small quantity", theme.ramp(0.0), 3.0),
                ("large quantity", theme.ramp(1.0), 3.0),
            ] {
                let found = contrast(colour, theme.pick(PAPER));
                assert!(found >= least, "{what} in {name}: {found}");
            }
        }
    }

    /// Returns the colour that people without long-wave cones see: Viénot, Brettel and Mollon 1999.
    fn protanope(colour: Colour) -> [f32; 3] {
        let [red, green, blue, _] = colour.linear();
        let yellow = 0.112_38 * red + 0.887_62 * green;
        [yellow, yellow, 0.004_01 * red - 0.004_01 * green + blue]
    }

    /// Returns the colour that people without medium-wave cones see: Viénot, Brettel and Mollon 1999.
    fn deuteranope(colour: Colour) -> [f32; 3] {
        let [red, green, blue, _] = colour.linear();
        let yellow = 0.292_75 * red + 0.707_25 * green;
        [yellow, yellow, -0.022_34 * red + 0.022_34 * green + blue]
    }

    /// Returns lightness and the two colour axes of Oklab (Ottosson 2020).
    fn oklab([red, green, blue]: [f32; 3]) -> Vector3<f32> {
        let cone = |r: f32, g: f32, b: f32| (r * red + g * green + b * blue).max(0.0).cbrt();
        let long = cone(0.412_221_47, 0.536_332_55, 0.051_445_995);
        let medium = cone(0.211_903_5, 0.680_699_5, 0.107_396_96);
        let short = cone(0.088_302_46, 0.281_718_85, 0.629_978_7);
        Vector3::new(
            0.210_454_26 * long + 0.793_617_8 * medium - 0.004_072_047 * short,
            1.977_998_5 * long - 2.428_592_2 * medium + 0.450_593_7 * short,
            0.025_904_037 * long + 0.782_771_77 * medium - 0.808_675_77 * short,
        )
    }

    /// Returns the smallest distance of two colours for normal, protanopic and deuteranopic vision.
    fn distance(a: u32, b: u32) -> f32 {
        let normal = |colour: Colour| [0, 1, 2].map(|k| colour.linear()[k]);
        let seen = [normal, protanope, deuteranope].map(|see| (oklab(see(Colour::hex(a))), oklab(see(Colour::hex(b)))));
        seen.iter().map(|(a, b)| (a - b).norm()).fold(f32::INFINITY, f32::min)
    }

    #[test]
    fn colour_blind_readers_can_tell_vehicles_apart() {
        for theme in [Theme::Dark, Theme::Light] {
            let palette = VEHICLES.map(|colour| theme.rgb(colour));
            for (k, &a) in palette.iter().enumerate() {
                assert!(contrast(Colour::hex(a), theme.pick(PAPER)) >= 3.0, "{a:x}");
                for &b in &palette[..k] {
                    assert!(distance(a, b) > 0.04, "{a:x} and {b:x}: {}", distance(a, b));
                }
            }
        }
        // Orange and olive of the scheme by Okabe and Ito, darkened for white paper, are one colour to protanopes.
        assert!(distance(0xD5_5E_00, 0x9A_76_00) < 0.03);
    }

    #[test]
    fn pushing_and_pulling_differ_for_protanopes() {
        for (name, theme) in Theme::ALL {
            let [push, rest, pull] = [-1.0, 0.0, 1.0].map(|tension| protanope(theme.tension(tension)));
            // One has more blue light than yellow, the other more yellow than blue.
            assert!(push[0] > push[2] && pull[2] > pull[0], "{name}: {push:?} {pull:?}");
            assert!((rest[0] - rest[2]).abs() < 0.1, "{name}: {rest:?}");
        }
    }

    #[test]
    fn linear_colours_and_interpolation_are_correct() {
        assert_eq!(Colour::hex(0x00_80_FF).linear(), [0.0, 0.215_860_53, 1.0, 1.0]);
        assert_eq!(Colour::hex(0).towards(Colour::hex(0xFF_FF_FF), 0.5), Colour::hex(0x80_80_80));
    }
}

//! Colours of drawings. Colour-blind readers can distinguish those of vehicles, links and quantities.

use std::fmt::Write as _;

/// Colour on a light and on a dark background, and the variable of a page's style sheet that holds it. The variable is
/// empty for a colour of pictures alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ThemeColour {
    variable: &'static str,
    /// `0xRRGGBB` on a light background.
    pub light: u32,
    /// `0xRRGGBB` on a dark background.
    pub dark: u32,
}

const fn colour(variable: &'static str, light: u32, dark: u32) -> ThemeColour {
    ThemeColour { variable, light, dark }
}

/// Background of a chart or a picture.
pub const PAPER: ThemeColour = colour("--plot", 0xFF_FF_FF, 0x14_19_1F);
/// Text.
pub const INK: ThemeColour = colour("--ink", 0x1B_1F_24, 0xE6_EA_EF);
/// Secondary text.
pub const SOFT_INK: ThemeColour = colour("--soft", 0x57_60_6A, 0x9A_A4_AF);
/// Lines on the ground, and borders.
pub const LINE: ThemeColour = colour("--line", 0xD5_DA_E0, 0x31_3A_44);
/// Grid of a chart.
pub const GRID: ThemeColour = colour("--grid", 0xE1_E4_E8, 0x2A_32_3B);
/// Obstacles.
pub const OBSTACLE: ThemeColour = colour("--thing", 0x8A_6D_3B, 0xB8_A0_78);
/// Violations.
pub const ALARM: ThemeColour = colour("--alarm", 0xD4_00_14, 0xFF_2F_3C);
/// Clear verdicts.
pub const GOOD: ThemeColour = colour("--good", 0x11_63_29, 0x6F_DD_8B);
/// Keep-out shells.
pub const SHELL: ThemeColour = colour("--shell", 0x5C_7F_A3, 0x8F_B4_D9);
/// Links that push, are at rest, and pull.
pub const LINKS: [ThemeColour; 3] = [
    colour("--push", 0xC8_5A_00, 0xFF_9E_2C),
    colour("--rest", 0xA6_AE_B7, 0x6B_75_80),
    colour("--pull", 0x0A_5E_A8, 0x4F_A3_FF),
];

/// Vehicles in order, and lines of charts, from Paul Tol's colour-blind safe schemes (technical note
/// SRON/EPS/TN/09-002, issue 3.2). The dark theme has the scheme "light" without grey. The light theme has "muted".
/// There the light blue of "medium-contrast" replaces cyan and sand, and teal is darker, for a contrast of 3 on white.
pub const VEHICLES: [ThemeColour; 8] = [
    colour("--c1", 0x33_22_88, 0x77_AA_DD),
    colour("--c2", 0xCC_66_77, 0xEE_88_66),
    colour("--c3", 0x3F_9E_8E, 0x44_BB_99),
    colour("--c4", 0xAA_44_99, 0xFF_AA_BB),
    colour("--c5", 0x99_99_33, 0xEE_DD_88),
    colour("--c6", 0x66_99_CC, 0x99_DD_FF),
    colour("--c7", 0x11_77_33, 0xBB_CC_33),
    colour("--c8", 0x88_22_55, 0xAA_AA_00),
];

/// Quantities of vehicles from small to large.
pub const QUANTITIES: [ThemeColour; 4] = [
    colour("--q1", 0x2A_4C_C8, 0x5B_8D_EF),
    colour("--q2", 0x8F_2F_B5, 0xB9_7A_E0),
    colour("--q3", 0xC8_3B_6B, 0xF0_72_8F),
    colour("--q4", 0xC2_5A_00, 0xFF_C2_3D),
];

/// Lights from the left to the right of a swarm, on any background.
pub const LIGHTS: [ThemeColour; 4] = [
    colour("--l1", 0xFF_C2_3D, 0xFF_C2_3D),
    colour("--l2", 0x6F_E3_9A, 0x6F_E3_9A),
    colour("--l3", 0x4F_B8_FF, 0x4F_B8_FF),
    colour("--l4", 0xB0_94_FF, 0xB0_94_FF),
];
/// Sky behind lights.
pub const NIGHT: ThemeColour = colour("--night", 0x06_0A_18, 0x06_0A_18);

/// Text on the colour of violations.
pub const ON_ALARM: ThemeColour = colour("", 0xFF_FF_FF, 0x14_00_02);
/// Axes x, y and z.
pub const AXES: [ThemeColour; 3] =
    [colour("", 0xB0_2A_37, 0xE0_6C_75), colour("", 0x2B_7A_2B, 0x7F_C9_7F), colour("", 0x1F_5F_B0, 0x61_AF_EF)];

/// Colours that the figures of a page take from its style sheet.
const OF_FIGURES: [ThemeColour; 6] = [PAPER, INK, SOFT_INK, GRID, OBSTACLE, ALARM];

impl ThemeColour {
    /// Returns the colour on a light background, such as `#1B1F24`.
    pub(crate) fn hex(self) -> String {
        hex(self.light)
    }
}

fn hex(rgb: u32) -> String {
    format!("#{rgb:06X}")
}

/// Returns the rule of a style sheet that declares the colours.
pub(crate) fn variables() -> String {
    let single = OF_FIGURES.into_iter().chain([LINE, GOOD, SHELL, NIGHT]);
    let mut rule = ":root{".to_owned();
    for ThemeColour { variable, light, dark } in single.chain(LINKS).chain(VEHICLES).chain(QUANTITIES).chain(LIGHTS) {
        // Writing to a string cannot fail.
        let _ = if light == dark {
            write!(rule, "{variable}:{};", hex(light))
        } else {
            write!(rule, "{variable}:light-dark({},{});", hex(light), hex(dark))
        };
    }
    rule + "}\n"
}

/// Returns the rules that give the figures of a page its colours. A file has none and stays readable on white paper.
pub(crate) fn figure_rules() -> String {
    let rules = OF_FIGURES.into_iter().chain(VEHICLES).flat_map(|colour| {
        let (light, variable) = (colour.hex(), colour.variable);
        ["fill", "stroke"].map(|paint| format!(".tautline-figure [{paint}=\"{light}\"]{{{paint}:var({variable})}}"))
    });
    rules.collect()
}

/// Interpolates between at least two even colours `0xRRGGBB`; `part` is from 0 to 1. Returns red, green and blue.
#[must_use]
pub fn mixed(colours: &[u32], part: f64) -> [u8; 3] {
    let last = colours.len() - 1;
    let along = part.clamp(0.0, 1.0) * last as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and the number of colours")]
    let below = (along as usize).min(last - 1);
    let [[_, from @ ..], [_, to @ ..]] = [colours[below], colours[below + 1]].map(u32::to_be_bytes);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 255")]
    let channel = |k: usize| {
        let [from, to] = [from[k], to[k]].map(f64::from);
        (from + (along - below as f64) * (to - from)).round() as u8
    };
    [0, 1, 2].map(channel)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_style_sheet_declares_each_colour_once() {
        let rule = variables();
        assert!(rule.contains("--ink:light-dark(#1B1F24,#E6EAEF);") && rule.contains("--night:#060A18;"), "{rule}");
        assert_eq!(rule.matches("--").count(), 10 + 3 + 8 + 4 + 4);
    }

    #[test]
    fn colours_are_interpolated_and_clamped() {
        let grey = |part| mixed(&[0x00_00_00, 0x33_33_33, 0xFF_FF_FF], part)[0];
        assert_eq!([-1.0, 0.0, 0.25, 0.5, 1.0, 2.0].map(grey), [0, 0, 26, 51, 255, 255]);
    }
}

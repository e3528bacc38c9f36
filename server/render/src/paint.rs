//! From the templates to SVG and from SVG to pixels: the embedded drawings and fonts, text that is made to fit, PNG. What a picture shows
//! and where is decided by the modules beside this one.

use std::collections::{BTreeSet, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment, UndefinedBehavior};
use resvg::tiny_skia::{Color, Pixmap, Transform};
use resvg::usvg::{self, fontdb};
use serde::Serialize;
use skrifa::{FontRef, MetadataProvider as _};
use unicode_normalization::UnicodeNormalization as _;
use unicode_normalization::char::is_combining_mark;

/// Family of the embedded font.
const FONT: &str = "Atkinson Hyperlegible Next";
const REGULAR: &[u8] = include_bytes!("../../assets/font/AtkinsonHyperlegibleNext-Regular.ttf");
const BOLD: &[u8] = include_bytes!("../../assets/font/AtkinsonHyperlegibleNext-Bold.ttf");

/// A picture as pixels, row by row, without transparent ones.
pub type Pixels = Pixmap;

/// Fewest pixels a picture can be wide; below it nothing on it can be read.
pub const MIN_WIDTH: u32 = 160;
/// Most pixels a picture can be wide.
pub const MAX_WIDTH: u32 = 8000;

/// Most letters of a name that are looked at.
const MAX_LETTERS: usize = 200;

/// Stands for a letter that the font lacks.
const LACKING: char = '?';

/// Most widths that are kept.
const MAX_WIDTHS: usize = 4096;

const TEMPLATES: [(&str, &str); 4] = [
    ("table.svg", include_str!("templates/table.svg")),
    ("figure.svg", include_str!("templates/figure.svg")),
    ("style.svg", include_str!("templates/style.svg")),
    ("card.svg", include_str!("templates/card.svg")),
];

/// The drawings, by name. Each file is a picture of its own, so that others can use them too.
macro_rules! symbols {
    ($($name:literal),+ $(,)?) => {
        &[$(($name, include_str!(concat!("../../assets/symbols/", $name, ".svg")))),+]
    };
}

const SYMBOLS: &[(&str, &str)] = symbols![
    "face-1-truffle",
    "face-2-shrimp",
    "face-3-anchovy",
    "face-4-artichoke",
    "face-5-chilli",
    "face-6-basil",
    "face-7-olive",
    "face-8-pepper",
    "face-9-mushroom",
    "face-10-tomato",
    "face-11-mozzarella",
    "golden",
    "joker",
    "plate",
    "kind-agent",
    "kind-built-in",
    "kind-open",
    "kind-person",
    "kind-robot",
    "role-chef",
    "role-cook",
    "role-dishwasher",
    "role-sous-chef",
    "role-waiter",
];

/// What a picture could not be made for.
#[derive(Debug, thiserror::Error)]
pub enum PaintError {
    /// The width is out of range.
    #[error("a picture is {MIN_WIDTH} to {MAX_WIDTH} pixels wide, not {0}")]
    Width(u32),
    /// The PNG could not be written.
    #[error("the picture cannot be written as PNG: {0}")]
    Png(String),
}

/// Draws scenes and figures. Making one loads fonts and templates; it can be used by many threads.
pub struct Painter {
    environment: Environment<'static>,
    options: usvg::Options<'static>,
    /// The letters that the font has.
    letters: BTreeSet<char>,
    /// Widths that have been measured: most words of a film come again.
    widths: Mutex<HashMap<(String, u32, bool), f32>>,
}

impl std::fmt::Debug for Painter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Painter").finish_non_exhaustive()
    }
}

impl Default for Painter {
    fn default() -> Self {
        Self::new()
    }
}

impl Painter {
    /// A painter. No font of the system is used, so that it paints the same everywhere.
    pub fn new() -> Self {
        let mut environment = Environment::new();
        environment.set_auto_escape_callback(|_| AutoEscape::Html);
        environment.set_undefined_behavior(UndefinedBehavior::Strict);
        environment.set_formatter(|out, state, value| match f64::try_from(value.clone()) {
            // Hundredths are finer than anybody sees.
            Ok(number) if !value.is_integer() => {
                write!(out, "{}", (number * 100.0).round() / 100.0)?;
                Ok(())
            }
            _ => minijinja::escape_formatter(out, state, value),
        });
        let mut syntax = environment.syntax().to_builder();
        syntax.trim_blocks(true).lstrip_blocks(true);
        environment.set_syntax(
            syntax
                .build()
                .expect("the standard delimiters are distinct"),
        );
        for (name, text) in TEMPLATES {
            environment
                .add_template(name, text)
                .expect("the embedded templates are well-formed");
        }
        environment.add_function("symbol", symbol);
        let mut fonts = fontdb::Database::new();
        for font in [REGULAR, BOLD] {
            fonts.load_font_source(fontdb::Source::Binary(Arc::new(font)));
        }
        let options = usvg::Options {
            font_family: FONT.to_owned(),
            fontdb: Arc::new(fonts),
            ..usvg::Options::default()
        };
        Self {
            environment,
            options,
            letters: letters(),
            widths: Mutex::default(),
        }
    }

    /// Fills in a template.
    pub(super) fn fill(&self, template: &str, values: &impl Serialize) -> String {
        self.environment
            .get_template(template)
            .and_then(|template| template.render(Serde(values)))
            .expect("the embedded templates name only what they are given")
    }

    /// The same picture with all text as outlines, so many units wide: it looks the same wherever it is opened, whatever fonts there are.
    ///
    /// # Errors
    /// If the width is below [`MIN_WIDTH`] or above [`MAX_WIDTH`].
    pub fn outlined(&self, svg: &str, width: u32) -> Result<String, PaintError> {
        let tree = self.tree(svg, width)?;
        let text = tree.to_string(&usvg::WriteOptions::default());
        let (from, height) = (tree.size().width(), tree.size().height());
        let scaled = (height * width as f32 / from).round();
        Ok(text.replacen(
            &format!(r#"<svg width="{from}" height="{height}""#),
            &format!(r#"<svg viewBox="0 0 {from} {height}" width="{width}" height="{scaled}""#),
            1,
        ))
    }

    fn tree(&self, svg: &str, width: u32) -> Result<usvg::Tree, PaintError> {
        if !(MIN_WIDTH..=MAX_WIDTH).contains(&width) {
            return Err(PaintError::Width(width));
        }
        Ok(usvg::Tree::from_str(svg, &self.options).expect("our own SVG is well-formed"))
    }

    /// An SVG picture as pixels, so many wide; as high as its form asks for.
    ///
    /// # Errors
    /// If the width is below [`MIN_WIDTH`] or above [`MAX_WIDTH`].
    pub fn pixels(&self, svg: &str, width: u32) -> Result<Pixels, PaintError> {
        let tree = self.tree(svg, width)?;
        let size = tree.size();
        let scale = width as f32 / size.width();
        let height = ((size.height() * scale).round() as u32).max(1);
        let mut pixmap = Pixmap::new(width, height).expect("a picture has pixels");
        // A last row that the picture fills in part only is no hole in it.
        pixmap.fill(Color::WHITE);
        resvg::render(
            &tree,
            Transform::from_scale(scale, scale),
            &mut pixmap.as_mut(),
        );
        Ok(pixmap)
    }

    /// Pixels as a PNG file.
    ///
    /// # Errors
    /// If they cannot be encoded.
    pub fn png(&self, pixels: &Pixels) -> Result<Vec<u8>, PaintError> {
        pixels
            .encode_png()
            .map_err(|error| PaintError::Png(error.to_string()))
    }

    /// A name or label as it can be shown: no letters but those of the font, and cut with an ellipsis where it is wider than `width`.
    pub(super) fn fit(&self, text: &str, size: f32, bold: bool, width: f32) -> String {
        let letters: Vec<char> = text
            .chars()
            .filter(|&letter| !steers(letter))
            .flat_map(|letter| self.in_font(letter))
            .take(MAX_LETTERS)
            .collect();
        let whole: String = letters.iter().collect();
        if self.width(&whole, size, bold) <= width {
            return whole;
        }
        let cut = |kept: usize| -> String {
            let kept: String = letters[..kept].iter().collect();
            format!("{}…", kept.trim_end())
        };
        let (mut fits, mut too_wide) = (0, letters.len());
        while fits + 1 < too_wide {
            let middle = fits.midpoint(too_wide);
            if self.width(&cut(middle), size, bold) <= width {
                fits = middle;
            } else {
                too_wide = middle;
            }
        }
        cut(fits)
    }

    /// A letter as the font can show it: itself, or without marks that the font lacks, or what stands for it.
    fn in_font(&self, letter: char) -> Vec<char> {
        let has = |letter: &char| self.letters.contains(letter);
        if has(&letter) {
            return vec![letter];
        }
        if letter.is_whitespace() {
            return vec![' '];
        }
        let mut parts: Vec<char> = [letter].into_iter().nfd().collect();
        let base_lacks = parts.first().is_none_or(|base| !has(base));
        parts.retain(has);
        if base_lacks && !is_combining_mark(letter) {
            return vec![LACKING];
        }
        parts
    }

    /// How wide a line of text is.
    pub(super) fn width(&self, text: &str, size: f32, bold: bool) -> f32 {
        let key = (text.to_owned(), size.to_bits(), bold);
        if let Some(&width) = self.widths().get(&key) {
            return width;
        }
        let width = self.measure(text, size, bold);
        let mut widths = self.widths();
        if widths.len() >= MAX_WIDTHS {
            widths.clear();
        }
        widths.insert(key, width);
        width
    }

    fn widths(&self) -> MutexGuard<'_, HashMap<(String, u32, bool), f32>> {
        // Whoever panicked while holding it left nothing half done: each entry stands for itself.
        self.widths.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn measure(&self, text: &str, size: f32, bold: bool) -> f32 {
        let weight = if bold { 700 } else { 400 };
        let text = minijinja::HtmlEscape(text);
        let svg = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><text font-size="{size}" font-weight="{weight}">{text}</text></svg>"#
        );
        let tree = usvg::Tree::from_str(&svg, &self.options).expect("our own SVG is well-formed");
        tree.root().bounding_box().width()
    }
}

/// A drawing without its frame, to be placed in a picture.
fn symbol(name: &str) -> Result<minijinja::Value, minijinja::Error> {
    let (_, file) = SYMBOLS
        .iter()
        .find(|(known, _)| {
            *known == name || known.rsplit_once('-').is_some_and(|(face, _)| face == name)
        })
        .ok_or_else(|| {
            minijinja::Error::new(
                minijinja::ErrorKind::InvalidOperation,
                format!("there is no drawing {name}"),
            )
        })?;
    let inner = file
        .split_once('>')
        .and_then(|(_, rest)| rest.rsplit_once("</svg>"))
        .map_or("", |(inner, _)| inner.trim());
    Ok(minijinja::Value::from_safe_string(inner.to_owned()))
}

/// The letters of the embedded fonts, which have the same.
fn letters() -> BTreeSet<char> {
    let font = FontRef::new(REGULAR).expect("the embedded font is well-formed");
    let known = font.charmap();
    let letters = known.mappings().filter(|(_, glyph)| glyph.to_u32() > 0);
    letters
        .filter_map(|(letter, _)| char::from_u32(letter))
        .collect()
}

/// Control characters, which no SVG may hold, and those that are not seen themselves: they turn the direction of writing, or join or vary
/// what stands around them.
fn steers(letter: char) -> bool {
    letter.is_control()
        || matches!(letter, '\u{ad}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}')
        || matches!(letter, '\u{fe00}'..='\u{fe0f}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}' | '\u{e0000}'..='\u{e0fff}')
}

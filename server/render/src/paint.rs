//! Templates to SVG, SVG to pixels, pixels to PNG, with embedded sprites and fonts; fits text.

use std::collections::{BTreeSet, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use chefshat_record::words::is_invisible;
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

/// A picture as opaque pixels.
pub type Pixels = Pixmap;

/// The smallest width in pixels that can be read.
pub const MIN_WIDTH: u32 = 160;
/// The largest width in pixels.
pub const MAX_WIDTH: u32 = 8000;

/// The most characters of a name.
const MAX_LETTERS: usize = 200;

/// Replaces characters the font lacks.
const REPLACEMENT: char = '?';

/// The most cached widths.
const MAX_WIDTHS: usize = 4096;

const TEMPLATES: [(&str, &str); 4] = [
    ("table.svg", include_str!("templates/table.svg")),
    ("figure.svg", include_str!("templates/figure.svg")),
    ("style.svg", include_str!("templates/style.svg")),
    ("card.svg", include_str!("templates/card.svg")),
];

/// The sprites, by name. The web page uses the same files.
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
    "kind-model",
    "kind-open",
    "kind-person",
    "kind-robot",
    "role-chef",
    "role-cook",
    "role-dishwasher",
    "role-sous-chef",
    "role-waiter",
];

/// A failure to make a picture.
#[derive(Debug, thiserror::Error)]
pub enum PaintError {
    /// The width is out of range.
    #[error("the width must be {MIN_WIDTH} to {MAX_WIDTH} pixels, not {0}")]
    Width(u32),
    /// The PNG encoder failed.
    #[error("cannot encode the picture as PNG: {0}")]
    Png(String),
}

/// Draws scenes and figures. Expensive to create (fonts, templates); can be shared by threads.
pub struct Painter {
    environment: Environment<'static>,
    options: usvg::Options<'static>,
    /// The characters of the font.
    letters: BTreeSet<char>,
    /// A cache of text widths: most words of a film recur.
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
    /// A painter that does not use system fonts, so that pictures are the same everywhere.
    pub fn new() -> Self {
        let mut environment = Environment::new();
        environment.set_auto_escape_callback(|_| AutoEscape::Html);
        environment.set_undefined_behavior(UndefinedBehavior::Strict);
        environment.set_formatter(|out, state, value| match f64::try_from(value.clone()) {
            // Hundredths are precise enough.
            Ok(number) if !value.is_integer() => {
                write!(out, "{}", (number * 100.0).round() / 100.0)?;
                Ok(())
            }
            _ => minijinja::escape_formatter(out, state, value),
        });
        let mut syntax = environment.syntax().to_builder();
        syntax.trim_blocks(true).lstrip_blocks(true);
        environment.set_syntax(syntax.build().expect("the default delimiters are distinct"));
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

    /// Renders a template.
    pub(super) fn fill(&self, template: &str, values: &impl Serialize) -> String {
        self.environment
            .get_template(template)
            .and_then(|template| template.render(Serde(values)))
            .expect("the embedded templates match their values")
    }

    /// Converts all text of an SVG to outlines, so that it does not depend on installed fonts.
    ///
    /// # Errors
    /// The width is not in [`MIN_WIDTH`]..=[`MAX_WIDTH`].
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
        Ok(usvg::Tree::from_str(svg, &self.options).expect("generated SVG is well-formed"))
    }

    /// Rasterizes an SVG, keeping its aspect ratio.
    ///
    /// # Errors
    /// The width is not in [`MIN_WIDTH`]..=[`MAX_WIDTH`].
    pub fn pixels(&self, svg: &str, width: u32) -> Result<Pixels, PaintError> {
        let tree = self.tree(svg, width)?;
        let size = tree.size();
        let scale = width as f32 / size.width();
        let height = ((size.height() * scale).round() as u32).max(1);
        let mut pixmap = Pixmap::new(width, height).expect("a picture has pixels");
        // The last row may be covered only in part.
        pixmap.fill(Color::WHITE);
        resvg::render(
            &tree,
            Transform::from_scale(scale, scale),
            &mut pixmap.as_mut(),
        );
        Ok(pixmap)
    }

    /// Encodes pixels as PNG.
    ///
    /// # Errors
    /// The encoder failed.
    pub fn png(&self, pixels: &Pixels) -> Result<Vec<u8>, PaintError> {
        pixels
            .encode_png()
            .map_err(|error| PaintError::Png(error.to_string()))
    }

    /// Fits a text: replaces characters the font lacks, and shortens it to `width` with an
    /// ellipsis.
    pub(super) fn fit(&self, text: &str, size: f32, bold: bool, width: f32) -> String {
        let letters: Vec<char> = text
            .chars()
            // SVG forbids control characters and some others.
            .filter(|&letter| !letter.is_control() && !is_invisible(letter))
            .filter(|letter| !matches!(letter, '\u{fffe}' | '\u{ffff}'))
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

    /// A character as the font can show it: itself, without marks the font lacks, or the
    /// replacement.
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
            return vec![REPLACEMENT];
        }
        parts
    }

    /// The width of a line of text.
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
        // A panic leaves the cache consistent: entries are independent.
        self.widths.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn measure(&self, text: &str, size: f32, bold: bool) -> f32 {
        let weight = if bold { 700 } else { 400 };
        let text = minijinja::HtmlEscape(text);
        let svg = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><text font-size="{size}" font-weight="{weight}">{text}</text></svg>"#
        );
        let tree = usvg::Tree::from_str(&svg, &self.options).expect("generated SVG is well-formed");
        tree.root().bounding_box().width()
    }
}

/// The content of a sprite, without its `svg` element.
fn symbol(name: &str) -> Result<minijinja::Value, minijinja::Error> {
    let (_, file) = SYMBOLS
        .iter()
        .find(|(known, _)| {
            *known == name || known.rsplit_once('-').is_some_and(|(face, _)| face == name)
        })
        .ok_or_else(|| {
            minijinja::Error::new(
                minijinja::ErrorKind::InvalidOperation,
                format!("there is no sprite {name}"),
            )
        })?;
    let inner = file
        .split_once('>')
        .and_then(|(_, rest)| rest.rsplit_once("</svg>"))
        .map_or("", |(inner, _)| inner.trim());
    Ok(minijinja::Value::from_safe_string(inner.to_owned()))
}

/// The characters of the embedded fonts, which have the same.
fn letters() -> BTreeSet<char> {
    let font = FontRef::new(REGULAR).expect("the embedded font is well-formed");
    let known = font.charmap();
    let letters = known.mappings().filter(|(_, glyph)| glyph.to_u32() > 0);
    letters
        .filter_map(|(letter, _)| char::from_u32(letter))
        .collect()
}

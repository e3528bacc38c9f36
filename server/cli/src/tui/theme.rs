//! Colours and symbols. Every colour stands beside a number, a symbol or a word, so that none is
//! needed; `NO_COLOR` turns them off.

use chefshat_client::v1;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::Line;
use ratatui::widgets::{Block, BorderType};

use crate::narration::view::SeatView;

/// The ingredients of the eleven faces of the standard deck, rarest first.
const INGREDIENTS: [&str; 11] = [
    "truffle",
    "shrimp",
    "anchovy",
    "artichoke",
    "chilli",
    "basil",
    "olive",
    "pepper",
    "mushroom",
    "tomato",
    "mozzarella",
];

/// Colours of the ingredients, of the 256-colour palette: legible on black and on white.
const FACE_COLOURS: [u8; 11] = [130, 209, 67, 107, 160, 34, 100, 172, 137, 167, 179];

/// Colours of the seats, as in `chefshat demo`.
const SEAT_COLOURS: [Color; 6] = [
    Color::Cyan,
    Color::Yellow,
    Color::Magenta,
    Color::Green,
    Color::Blue,
    Color::Red,
];

/// The styles of the terminal client.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Theme {
    colours: bool,
}

impl Theme {
    /// With colours or without.
    pub(crate) fn new(colours: bool) -> Self {
        Self { colours }
    }

    /// With colours unless `NO_COLOR` is set.
    pub(crate) fn of_environment() -> Self {
        Self::new(std::env::var_os("NO_COLOR").is_none_or(|set| set.is_empty()))
    }

    fn fg(self, colour: Color) -> Style {
        if self.colours {
            Style::new().fg(colour)
        } else {
            Style::new()
        }
    }

    /// A seat's name.
    pub(crate) fn seat(self, seat: u32) -> Style {
        let index = usize::try_from(seat).unwrap_or(0) % SEAT_COLOURS.len();
        self.fg(SEAT_COLOURS[index])
    }

    /// The frame of a card, or of a joker for faces above `faces`.
    pub(crate) fn card(self, face: u32, faces: u32) -> Style {
        let index = usize::try_from(face).ok().and_then(|it| it.checked_sub(1));
        match index.and_then(|index| FACE_COLOURS.get(index)) {
            Some(colour) if face <= faces => self.fg(Color::Indexed(*colour)),
            _ if face > faces => self.fg(Color::Magenta),
            _ => Style::new(),
        }
    }

    /// Emphasised text.
    pub(crate) fn bold(self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }

    /// Secondary text.
    pub(crate) fn dim(self) -> Style {
        Style::new().add_modifier(Modifier::DIM)
    }

    /// The Golden card, winners.
    pub(crate) fn gold(self) -> Style {
        self.fg(Color::Yellow).add_modifier(Modifier::BOLD)
    }

    /// Warnings.
    pub(crate) fn warning(self) -> Style {
        self.fg(Color::Red).add_modifier(Modifier::BOLD)
    }

    /// The header line.
    pub(crate) fn header(self) -> Style {
        if self.colours {
            Style::new()
                .bg(Color::Indexed(94))
                .fg(Color::Indexed(230))
                .add_modifier(Modifier::BOLD)
        } else {
            Style::new().add_modifier(Modifier::REVERSED | Modifier::BOLD)
        }
    }

    /// Frames.
    pub(crate) fn frame(self) -> Style {
        self.fg(Color::Indexed(137))
    }

    /// A box with a title, around a part of the table.
    pub(crate) fn boxed<'a>(self, title: impl Into<Line<'a>>) -> Block<'a> {
        Block::bordered()
            .border_type(BorderType::Rounded)
            .border_style(self.frame())
            .title(title)
    }
}

/// The ingredient of a face; only the faces of the standard deck have one.
pub(crate) fn ingredient(face: u32, faces: u32) -> Option<&'static str> {
    let index = usize::try_from(face).ok()?.checked_sub(1)?;
    INGREDIENTS.get(index).filter(|_| face <= faces).copied()
}

/// Symbol and word for a seat.
pub(crate) fn kind(place: &SeatView) -> (&'static str, &'static str) {
    match place.name.is_empty() {
        true => ("·", "free"),
        false => symbol(place.kind),
    }
}

/// Symbol and word for a kind of participant.
pub(crate) fn symbol(kind: v1::ParticipantKind) -> (&'static str, &'static str) {
    match kind {
        v1::ParticipantKind::Human => ("☺", "person"),
        v1::ParticipantKind::Robot => ("▣", "robot"),
        v1::ParticipantKind::Model => ("✦", "model"),
        v1::ParticipantKind::Agent | v1::ParticipantKind::Unspecified => ("◆", "agent"),
    }
}

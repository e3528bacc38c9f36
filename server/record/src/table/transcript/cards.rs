//! Cards as they are written in a transcript.

use chefshat_engine::{Action, Cards, Face};

use crate::table::facts::{Counts, JOKER, index};

/// The faces of written cards, `None` for a joker: numbers, `J`, and `G` for the Golden card.
pub(super) fn kinds(text: &str, faces: u8) -> Result<Vec<Option<Face>>, String> {
    text.split_whitespace()
        .map(|word| match word {
            "J" | "j" => Ok(None),
            "G" | "g" => Ok(Face::new(faces)),
            word => match word.parse().ok().and_then(Face::new) {
                Some(face) if face.get() <= faces => Ok(Some(face)),
                _ => Err(format!(
                    "{word:?} is no card: write the faces 1..={faces}, J for a joker, G for the Golden card, with spaces between them"
                )),
            },
        })
        .collect()
}

/// Written cards as the engine counts them.
pub(super) fn cards(text: &str, faces: u8) -> Result<Cards, String> {
    let golden = text
        .split_whitespace()
        .filter(|word| word.eq_ignore_ascii_case("g"))
        .count();
    let mut counts: Counts = [0; JOKER + 1];
    for kind in kinds(text, faces)? {
        let count = &mut counts[kind.map_or(JOKER, index)];
        *count = count.saturating_add(1);
    }
    let mut list = counts[..usize::from(faces)].to_vec();
    list.push(counts[JOKER]);
    Cards::from_counts(faces, &list, golden > 0)
        .filter(|_| golden <= 1)
        .ok_or_else(|| "no deck has so many cards of one kind".into())
}

/// A written play: cards of one face with any jokers, or one joker alone.
pub(super) fn play(text: &str, faces: u8) -> Result<Action, String> {
    let kinds = kinds(text, faces)?;
    let jokers = kinds.iter().filter(|kind| kind.is_none()).count();
    let mut faces = kinds.into_iter().flatten();
    let small =
        |count: usize| u8::try_from(count).map_err(|_| "these are too many cards".to_owned());
    match faces.next() {
        None if jokers == 1 => Ok(Action::LoneJoker),
        None => Err("jokers are played with cards of a face, or one of them alone".into()),
        Some(face) => {
            let rest: Vec<Face> = faces.collect();
            if rest.iter().any(|other| *other != face) {
                return Err("a play is cards of one face, with any jokers".into());
            }
            Ok(Action::Play {
                face,
                quantity: small(rest.len() + 1)?,
                jokers: small(jokers)?,
            })
        }
    }
}

//! Transcripts of recorded games, as an observer at a real table might have written them.

use std::fmt::Write as _;

use chefshat_engine::{Opening, PassScope, RuleSet, Stop};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

/// The part of a game that a transcript contains.
#[derive(Debug, Clone, Copy)]
pub struct Observed {
    /// Seats with their dealt hands, one bit each.
    pub hands: u32,
    /// Seats with their gifts, one bit each.
    pub gifts: u32,
    /// Whether declined special actions are included.
    pub declines: bool,
    /// The number of turns before the transcript breaks off.
    pub turns: usize,
}

impl Observed {
    /// All turns, but no hidden card.
    pub const TURNS: Self = Self {
        hands: 0,
        gifts: 0,
        declines: false,
        turns: usize::MAX,
    };
    /// All turns and all hidden cards.
    pub const EVERYTHING: Self = Self {
        hands: u32::MAX,
        gifts: u32::MAX,
        declines: true,
        turns: usize::MAX,
    };
}

fn rules_text(rules: &RuleSet) -> String {
    let spec = rules.spec();
    let on = |on| if on { "on" } else { "off" };
    let mut text = format!(
        "paper players={} faces={} jokers={} exchange={} special_actions={}",
        spec.players,
        spec.faces,
        spec.jokers,
        on(spec.exchange),
        on(spec.special_actions)
    );
    match spec.stop {
        Stop::Points(points) => write!(text, " target_points={points}"),
        Stop::Shifts(shifts) => write!(text, " target_shifts={shifts}"),
    }
    .unwrap();
    let points: Vec<String> = spec.points.iter().map(u32::to_string).collect();
    write!(text, " points={}", points.join("/")).unwrap();
    if spec.opening == Opening::AnyTopFace {
        text.push_str(" opening=any_top_face");
    }
    if spec.opening_pass {
        text.push_str(" opening_pass=allowed");
    }
    if spec.pass_scope == PassScope::Turn {
        text.push_str(" pass_scope=turn");
    }
    text
}

fn cards_text(cards: &[u32], golden: bool, faces: u32) -> String {
    let mut golden = golden;
    let words: Vec<String> = cards
        .iter()
        .map(|card| match *card {
            card if card > faces => "J".to_owned(),
            card if card == faces && std::mem::take(&mut golden) => "G".to_owned(),
            card => card.to_string(),
        })
        .collect();
    words.join(" ")
}

/// A transcript of a recorded game with what was observed.
pub fn transcript(rules: &RuleSet, lines: &[v1::RecordLine], observed: Observed) -> String {
    let faces = u32::from(rules.faces());
    let mut text = String::from("shift,seat,what,value\n");
    writeln!(text, ",,rules,{}", rules_text(rules)).unwrap();
    for seat in 0..rules.players() {
        writeln!(text, ",{seat},human,player {seat}").unwrap();
    }
    let (mut shift, mut turns, mut rows) = (0, 0, String::new());
    for line in lines {
        if turns >= observed.turns {
            break;
        }
        match line.line.as_ref().unwrap() {
            Line::Decision(decision) if observed.declines && decision.text == "decline" => {
                writeln!(rows, "{shift},{},declines,", decision.seat).unwrap();
            }
            Line::Event(event) => match event.kind.as_ref().unwrap() {
                Kind::ShiftStarted(started) => {
                    shift = started.shift;
                    for hand in &started.hands {
                        if observed.hands >> hand.seat & 1 == 1 {
                            let cards = cards_text(&hand.cards, hand.golden, faces);
                            writeln!(rows, "{shift},{},hand,{cards}", hand.seat).unwrap();
                        }
                    }
                }
                Kind::SpecialActionDeclared(declared) => {
                    writeln!(rows, "{shift},{},declares,", declared.seat).unwrap();
                }
                Kind::CardsExchanged(exchanged) if observed.gifts >> exchanged.giver & 1 == 1 => {
                    let cards = cards_text(&exchanged.cards, exchanged.golden, faces);
                    writeln!(rows, "{shift},{},gives,{cards}", exchanged.giver).unwrap();
                }
                Kind::Play(play) => {
                    turns += 1;
                    let mut cards = vec![play.face; play.quantity as usize];
                    cards.extend(vec![faces + 1; play.jokers as usize]);
                    let cards = cards_text(&cards, false, faces);
                    writeln!(rows, "{shift},{},plays,{cards}", play.seat).unwrap();
                }
                Kind::Pass(pass) => {
                    turns += 1;
                    writeln!(rows, "{shift},{},passes,", pass.seat).unwrap();
                }
                Kind::SeatFinished(finished) => {
                    let place = finished.place;
                    writeln!(rows, "{shift},{},finishes,{place}", finished.seat).unwrap();
                }
                _ => {}
            },
            _ => {}
        }
    }
    text + &rows
}

//! A person's selection for an open decision: a stack of the hand, a number of its cards, a number
//! of jokers with them. Maps the selection to an action. What is legal, and what a play must be,
//! comes from the request; this module only words the refusals.

use chefshat_client::v1;
use chefshat_engine::{Action, ActionId, ActionSpace, Face, Mask};

use crate::narration::hand::{Hand, Stack};
use crate::numbers::counted;
use crate::tui::view::play_words;

/// Actions that a hint names: those that fit in a line.
const MAX_HINTED: usize = 3;

/// An open decision and the selection for it.
#[derive(Debug, Clone)]
pub(super) struct Decision {
    pub(super) request: v1::DecisionRequest,
    pub(super) stacks: Vec<Stack>,
    legal: Mask,
    space: ActionSpace,
    jokers_held: u8,
    /// Index in `stacks`; at a special action 0 declares and 1 declines.
    pub(super) at: usize,
    pub(super) quantity: u8,
    pub(super) jokers: u8,
}

impl Decision {
    /// Opens a decision with a legal action selected; `None` if the request is malformed.
    pub(super) fn open(request: v1::DecisionRequest, space: ActionSpace) -> Option<Self> {
        let observation = request.observation.as_ref()?;
        let hand = Hand {
            counts: observation.hand.clone(),
            golden: observation.golden,
        };
        let legal = Mask::from_bytes(&request.action_mask).filter(|mask| !mask.is_empty())?;
        let mut decision = Self {
            stacks: hand.stacks(),
            jokers_held: hand.jokers(),
            legal,
            space,
            at: 0,
            quantity: 1,
            jokers: 0,
            request,
        };
        decision.pick_default();
        Some(decision)
    }

    pub(super) fn kind(&self) -> v1::DecisionKind {
        self.request.kind()
    }

    /// Whether an action is legal.
    pub(super) fn is_legal(&self, action: ActionId) -> bool {
        self.legal.contains(action)
    }

    /// The stack under the cursor.
    fn stack(&self) -> Option<Stack> {
        self.stacks.get(self.at).copied()
    }

    /// The selected action, legal or not.
    pub(super) fn picked(&self) -> Option<ActionId> {
        if self.kind() == v1::DecisionKind::SpecialAction {
            return Some(if self.at == 0 {
                self.space.declare()
            } else {
                self.space.decline()
            });
        }
        let stack = self.stack()?;
        if self.kind() == v1::DecisionKind::Exchange {
            return match stack.joker {
                true => Some(self.space.give_joker()),
                false => self.space.give(face(stack)?),
            };
        }
        if stack.joker {
            return (self.quantity == 1).then(|| self.space.lone_joker());
        }
        self.space.encode(Action::Play {
            face: face(stack)?,
            quantity: self.quantity,
            jokers: self.jokers,
        })
    }

    pub(super) fn pass(&self) -> ActionId {
        self.space.pass()
    }

    /// The actions that declare the special action and decline it.
    pub(super) fn declare(&self) -> [ActionId; 2] {
        [self.space.declare(), self.space.decline()]
    }

    /// Numbers of cards and jokers that are legal with one stack, in the order of their actions.
    fn legal_with(&self, at: usize) -> impl Iterator<Item = (u8, u8)> + '_ {
        let stack = self.stacks.get(at).copied();
        self.legal.iter().filter_map(move |action| {
            let stack = stack?;
            match self.space.decode(action)? {
                Action::Play {
                    face,
                    quantity,
                    jokers,
                } if !stack.joker && u32::from(face.get()) == stack.face => {
                    Some((quantity, jokers))
                }
                Action::Give(face) if !stack.joker && u32::from(face.get()) == stack.face => {
                    Some((1, 0))
                }
                Action::LoneJoker | Action::GiveJoker if stack.joker => Some((1, 0)),
                _ => None,
            }
        })
    }

    /// Whether a legal action uses the stack.
    pub(super) fn is_active(&self, at: usize) -> bool {
        self.legal_with(at).next().is_some()
    }

    /// Whether anything but a pass is legal.
    pub(super) fn can_play(&self) -> bool {
        (0..self.stacks.len()).any(|at| self.is_active(at))
    }

    /// Selects the smallest legal play of the highest legal face.
    fn pick_default(&mut self) {
        if self.kind() == v1::DecisionKind::SpecialAction {
            return;
        }
        let plain = |at: &usize| !self.stacks[*at].joker;
        let active = |at: &usize| self.is_active(*at);
        let last = (0..self.stacks.len()).rev().filter(plain).find(active);
        let at = last.or_else(|| (0..self.stacks.len()).find(active));
        self.pick(at.unwrap_or(0));
    }

    /// Moves the cursor to a stack and selects its smallest legal play, with as few jokers as
    /// possible.
    pub(super) fn pick(&mut self, at: usize) {
        if at >= self.choices() {
            return;
        }
        self.at = at;
        let smallest = self
            .legal_with(at)
            .min_by_key(|(quantity, jokers)| (quantity.saturating_add(*jokers), *jokers));
        (self.quantity, self.jokers) = smallest.unwrap_or((1, 0));
    }

    /// Handles the key of a stack: moves the cursor to it, or, if it is there already, selects one
    /// card more and after the last one starts again with the smallest legal play.
    pub(super) fn press(&mut self, at: usize) {
        let stack = self.stacks.get(at);
        let all = stack.is_none_or(|stack| stack.joker || self.quantity >= stack.count);
        if at != self.at || all || self.kind() != v1::DecisionKind::Turn {
            self.pick(at);
        } else {
            self.more(true);
        }
    }

    /// Number of positions of the cursor.
    fn choices(&self) -> usize {
        match self.kind() {
            v1::DecisionKind::SpecialAction => 2,
            _ => self.stacks.len(),
        }
    }

    /// Moves the cursor left or right and wraps around at the ends.
    pub(super) fn step(&mut self, right: bool) {
        let choices = self.choices().max(1);
        let step = if right { 1 } else { choices - 1 };
        self.pick((self.at + step) % choices);
    }

    /// Moves the cursor to the next stack with a legal action.
    pub(super) fn step_active(&mut self, right: bool) {
        for _ in 0..self.choices() {
            self.step(right);
            if self.kind() == v1::DecisionKind::SpecialAction || self.is_active(self.at) {
                return;
            }
        }
    }

    /// Selects one card more or less of the stack.
    pub(super) fn more(&mut self, more: bool) {
        let Some(stack) = self.stack() else {
            return;
        };
        if self.kind() != v1::DecisionKind::Turn {
            return;
        }
        // A joker alone is played singly.
        let most = if stack.joker { 1 } else { stack.count };
        self.quantity = match more {
            true => self.quantity.saturating_add(1).min(most),
            false => self.quantity.saturating_sub(1).max(1),
        };
    }

    /// Adds a joker to the selected cards, or removes all when none is left to add; in the exchange
    /// selects a joker. False if there is none.
    pub(super) fn next_joker(&mut self) -> bool {
        let turn = self.kind() == v1::DecisionKind::Turn;
        let jokers = self.stacks.iter().position(|stack| stack.joker);
        match jokers {
            None => return false,
            Some(jokers) if turn && self.at == jokers => return false,
            Some(_) if turn && self.jokers < self.jokers_held => self.jokers += 1,
            Some(_) if turn => self.jokers = 0,
            Some(jokers) => self.pick(jokers),
        }
        true
    }

    /// The selection in words.
    pub(super) fn words(&self) -> String {
        match self.kind() {
            v1::DecisionKind::SpecialAction if self.at == 0 => "declare".to_owned(),
            v1::DecisionKind::SpecialAction => "decline".to_owned(),
            kind => {
                let Some(stack) = self.stack() else {
                    return "nothing".to_owned();
                };
                if kind == v1::DecisionKind::Exchange {
                    return match (stack.joker, stack.golden && stack.count == 1) {
                        (true, _) => "give a joker".to_owned(),
                        (false, true) => format!("give the Golden {}", stack.face),
                        (false, false) => format!("give one {}", stack.face),
                    };
                }
                let faces = u32::from(self.space.faces());
                let (quantity, jokers) = (self.quantity.into(), self.jokers.into());
                format!("play {}", play_words(stack.face, quantity, jokers, faces))
            }
        }
    }

    /// Selects an action, if it is legal and not a pass.
    pub(super) fn pick_action(&mut self, action: u32) {
        let legal = u16::try_from(action).ok().map(ActionId::new);
        let Some(action) = legal.filter(|action| self.is_legal(*action)) else {
            return;
        };
        if self.kind() == v1::DecisionKind::SpecialAction {
            self.at = usize::from(action != self.space.declare());
            return;
        }
        for at in 0..self.stacks.len() {
            for (quantity, jokers) in self.legal_with(at).collect::<Vec<_>>() {
                let before = (self.at, self.quantity, self.jokers);
                (self.at, self.quantity, self.jokers) = (at, quantity, jokers);
                if self.picked() == Some(action) {
                    return;
                }
                (self.at, self.quantity, self.jokers) = before;
            }
        }
    }

    /// A hint in words: the suggestion, and what the best actions are worth.
    pub(super) fn hint_words(&self, hint: &v1::Hint) -> String {
        let named = |action: u32| {
            let action = ActionId::new(u16::try_from(action).unwrap_or(u16::MAX));
            let mut like = self.clone();
            like.pick_action(u32::from(action.index()));
            match like.picked() == Some(action) {
                true => like.words(),
                false => "pass".to_owned(),
            }
        };
        let suggested = named(hint.action);
        let mut worth: Vec<&v1::ActionEstimate> = hint.actions.iter().collect();
        worth.sort_by(|a, b| b.points.total_cmp(&a.points));
        // The suggestion first.
        worth.sort_by_key(|it| it.action != hint.action);
        let values = worth.iter().take(MAX_HINTED);
        let values = values.map(|it| format!("{} {:.1}", named(it.action), it.points));
        match values.collect::<Vec<_>>() {
            values if values.is_empty() => format!("Hint: {suggested}."),
            values => format!("Hint, with expected points: {}", values.join(" · ")),
        }
    }

    /// Why the selection is illegal; `None` if it is legal.
    pub(super) fn objection(&self) -> Option<String> {
        if self.picked().is_some_and(|action| self.is_legal(action)) {
            return None;
        }
        let Some(stack) = self.stack() else {
            return Some("there is nothing to select".to_owned());
        };
        Some(match (self.kind(), self.request.play_requirement) {
            (v1::DecisionKind::Turn, Some(rule)) => self.unmet(&rule, stack),
            (v1::DecisionKind::Turn, None) => "this cannot be played now".to_owned(),
            _ => "this cannot be given now".to_owned(),
        })
    }

    /// Which part of the requirement the selection fails.
    fn unmet(&self, rule: &v1::PlayRequirement, stack: Stack) -> String {
        let (lowest, highest) = (rule.lowest_face, rule.highest_face);
        if opens_shift(rule) && stack.face != lowest {
            return match rule.golden_card {
                true => format!(
                    "the Shift opens with the Golden {lowest}: play {lowest}s, with or without jokers"
                ),
                false => format!(
                    "the Shift opens with face {lowest}: play {lowest}s, with or without jokers"
                ),
            };
        }
        if stack.joker {
            return "a joker alone can only open a pizza; add it to other cards with j".to_owned();
        }
        if highest == 0 {
            return "nothing beats this: you have to pass".to_owned();
        }
        if stack.face > highest {
            return format!("face {} is too high: play {highest} or lower", stack.face);
        }
        let need = counted(rule.fewest_cards.into(), "card");
        let held = u32::from(stack.count) + u32::from(self.jokers_held);
        if held < rule.fewest_cards {
            let face = stack.face;
            return format!(
                "you need {need} of one face: with jokers you have {held} of face {face}"
            );
        }
        format!("you need {need}: add one with ↑, a joker with j")
    }

    /// What the Shift's first turn must contain; `None` on other turns.
    pub(super) fn opening(&self) -> Option<String> {
        let rule = self.request.play_requirement?;
        opens_shift(&rule).then(|| match rule.golden_card {
            true => format!("The Golden {} opens the Shift.", rule.lowest_face),
            false => format!("Face {} opens the Shift.", rule.lowest_face),
        })
    }

    /// Why passing is illegal; `None` if it is legal.
    pub(super) fn pass_objection(&self) -> Option<&'static str> {
        if self.is_legal(self.pass()) {
            return None;
        }
        Some(match (self.kind(), self.request.play_requirement) {
            (v1::DecisionKind::Turn, Some(rule)) if opens_shift(&rule) => {
                "you cannot pass on the Shift's first turn"
            }
            (v1::DecisionKind::Turn, _) => {
                "nobody has played for several pizzas: you have to play now"
            }
            (v1::DecisionKind::Exchange, _) => {
                "you have to give a card: Enter gives the selected one"
            }
            _ => "declare with d or decline with n",
        })
    }
}

/// Whether a requirement is that of a Shift's first turn: only there is the lowest face above 1.
fn opens_shift(rule: &v1::PlayRequirement) -> bool {
    rule.lowest_face > 1
}

fn face(stack: Stack) -> Option<Face> {
    Face::new(u8::try_from(stack.face).ok()?)
}

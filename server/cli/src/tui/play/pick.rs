//! What a person has picked of an open decision: a stack of the hand, how many cards of it, how many jokers with them. Says which action that
//! is, and why not, where the server does not take it. What is legal is the server's word (its mask); only the reasons are found here.

use chefshat_client::v1;
use chefshat_engine::{Action, ActionId, ActionSpace, Face, Mask, Opening, RuleSet};

use crate::numbers::counted;
use crate::tui::hand::{Hand, Stack};
use crate::tui::view::play_words;

/// A decision that is open, and what is picked for it.
#[derive(Debug, Clone)]
pub(super) struct Decision {
    pub(super) request: v1::DecisionRequest,
    pub(super) stacks: Vec<Stack>,
    legal: Mask,
    space: ActionSpace,
    rules: RuleSet,
    jokers_held: u8,
    /// Index in `stacks`; at a special action 0 declares and 1 declines.
    pub(super) at: usize,
    pub(super) quantity: u8,
    pub(super) jokers: u8,
}

impl Decision {
    /// Opens a decision, with the first legal thing picked; `None` if it cannot be read.
    pub(super) fn open(request: v1::DecisionRequest, rules: RuleSet) -> Option<Self> {
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
            space: rules.actions(),
            rules,
            at: 0,
            quantity: 1,
            jokers: 0,
            request,
        };
        decision.pick_standard();
        Some(decision)
    }

    fn observation(&self) -> v1::Observation {
        self.request.observation.clone().unwrap_or_default()
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

    /// The action that is picked, legal or not.
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

    /// Passing, where this decision knows it.
    pub(super) fn pass(&self) -> ActionId {
        self.space.pass()
    }

    /// Declaring the special action, and declining.
    pub(super) fn declare(&self) -> [ActionId; 2] {
        [self.space.declare(), self.space.decline()]
    }

    /// The legal actions with the cards of one stack, ascending: fewest cards first.
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

    /// Whether anything legal can be done with a stack.
    pub(super) fn is_active(&self, at: usize) -> bool {
        self.legal_with(at).next().is_some()
    }

    /// Whether there is anything legal but to pass.
    pub(super) fn can_play(&self) -> bool {
        (0..self.stacks.len()).any(|at| self.is_active(at))
    }

    /// Picks what is most often wanted: of the least rare legal face as few cards as are needed.
    fn pick_standard(&mut self) {
        if self.kind() == v1::DecisionKind::SpecialAction {
            return;
        }
        let plain = |at: &usize| !self.stacks[*at].joker;
        let active = |at: &usize| self.is_active(*at);
        let last = (0..self.stacks.len()).rev().filter(plain).find(active);
        let at = last.or_else(|| (0..self.stacks.len()).find(active));
        self.pick(at.unwrap_or(0));
    }

    /// Puts the cursor on a stack and picks the smallest play of it that is legal, with as few jokers as possible.
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

    /// Takes the key of a stack: puts the cursor on it; when it is there already, takes one card more, and from all of them as few as are
    /// needed.
    pub(super) fn press(&mut self, at: usize) {
        let stack = self.stacks.get(at);
        let all = stack.is_none_or(|stack| stack.joker || self.quantity >= stack.count);
        if at != self.at || all || self.kind() != v1::DecisionKind::Turn {
            self.pick(at);
        } else {
            self.more(true);
        }
    }

    /// Over how much the cursor goes.
    fn choices(&self) -> usize {
        match self.kind() {
            v1::DecisionKind::SpecialAction => 2,
            _ => self.stacks.len(),
        }
    }

    /// Moves the cursor to the left or right, round at the ends.
    pub(super) fn step(&mut self, right: bool) {
        let choices = self.choices().max(1);
        let step = if right { 1 } else { choices - 1 };
        self.pick((self.at + step) % choices);
    }

    /// Moves the cursor to the next stack with which something legal can be done.
    pub(super) fn step_active(&mut self, right: bool) {
        for _ in 0..self.choices() {
            self.step(right);
            if self.kind() == v1::DecisionKind::SpecialAction || self.is_active(self.at) {
                return;
            }
        }
    }

    /// One card more or less of the stack.
    pub(super) fn more(&mut self, more: bool) {
        let Some(stack) = self.stack() else {
            return;
        };
        if self.kind() != v1::DecisionKind::Turn {
            return;
        }
        // Of jokers alone no more than one can be played.
        let most = if stack.joker { 1 } else { stack.count };
        self.quantity = match more {
            true => self.quantity.saturating_add(1).min(most),
            false => self.quantity.saturating_sub(1).max(1),
        };
    }

    /// One joker more with the cards, none after as many as there are; in an exchange a joker alone. Says whether there is one that can.
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

    /// What is picked, in words.
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

    /// Why what is picked is not legal; `None` when it is.
    pub(super) fn objection(&self) -> Option<String> {
        if self.picked().is_some_and(|action| self.is_legal(action)) {
            return None;
        }
        let Some(stack) = self.stack() else {
            return Some("there is nothing to pick".to_owned());
        };
        if self.kind() != v1::DecisionKind::Turn {
            return Some("this cannot be given now".to_owned());
        }
        Some(self.turn_objection(stack))
    }

    fn turn_objection(&self, stack: Stack) -> String {
        let seen = self.observation();
        let faces = u32::from(self.space.faces());
        if self.opens(&seen) && stack.face != faces {
            return match self.rules.opening() {
                Opening::Golden => {
                    format!("the Shift opens with the Golden {faces}: only {faces}s, and jokers")
                }
                Opening::AnyTopFace => format!("the Shift opens with face {faces}: no other face"),
            };
        }
        if seen.board_face == 0 {
            return "this cannot be played now".to_owned();
        }
        if stack.joker {
            return "a joker alone can only open a pizza; with other cards: j".to_owned();
        }
        if stack.face >= seen.board_face {
            let board = seen.board_face;
            return format!(
                "{} is not rarer than {board}: a lower face is needed",
                stack.face
            );
        }
        let have = u32::from(stack.count) + u32::from(self.jokers_held);
        if have < seen.board_size {
            let need = counted(u64::from(seen.board_size), "card");
            return format!(
                "{need} needed: of {} and jokers you have {have}",
                stack.face
            );
        }
        let need = counted(u64::from(seen.board_size), "card");
        format!("{need} needed: more with ↑, a joker with j")
    }

    /// What the Shift's first turn is bound to, if this is it.
    pub(super) fn opening(&self) -> Option<String> {
        if self.kind() != v1::DecisionKind::Turn || !self.opens(&self.observation()) {
            return None;
        }
        let face = self.space.faces();
        Some(match self.rules.opening() {
            Opening::Golden => format!("The Golden {face} opens the Shift."),
            Opening::AnyTopFace => format!("Face {face} opens the Shift."),
        })
    }

    /// Why passing is not legal; `None` when it is.
    pub(super) fn pass_objection(&self) -> Option<&'static str> {
        if self.is_legal(self.pass()) {
            return None;
        }
        Some(match self.kind() {
            v1::DecisionKind::Turn if self.opens(&self.observation()) => {
                "the Shift's first turn cannot be passed"
            }
            v1::DecisionKind::Turn => {
                "nobody has played for too many pizzas: this turn must be played"
            }
            v1::DecisionKind::Exchange => "a card must be given: Enter gives the one picked",
            _ => "declare with d or decline with n",
        })
    }

    /// Whether this is the first turn of a Shift.
    fn opens(&self, seen: &v1::Observation) -> bool {
        seen.board_face == 0
            && seen.pizza <= 1
            && seen.played.iter().all(|count| *count == 0)
            && seen.passed.iter().all(|passed| *passed == 0)
    }
}

fn face(stack: Stack) -> Option<Face> {
    Face::new(u8::try_from(stack.face).ok()?)
}

//! The built-in agent `greedy`: it sheds as many of its commonest cards as it can.

use chefshat_engine::{Action, ActionId, ActionSpace, Mask, Observation, Role};

/// Prefers, in this order: plays without jokers, the highest face, many cards. Passes only if
/// nothing can be played, gives its highest face, and declares the special action only in roles
/// that an exchange costs cards.
///
/// # Panics
/// If `legal` is empty.
pub(crate) fn greedy(observation: &Observation, legal: &Mask, space: ActionSpace) -> ActionId {
    let role = observation.seat.and_then(|seat| observation.roles[seat]);
    legal
        .iter()
        .max_by_key(|action| match space.decode(*action) {
            Some(Action::Play {
                face,
                quantity,
                jokers,
            }) => (
                3,
                -i16::from(jokers),
                i16::from(face.get()),
                i16::from(quantity),
            ),
            Some(Action::LoneJoker) => (3, -1, -1, 0),
            Some(Action::Give(face)) => (3, 0, i16::from(face.get()), 0),
            Some(Action::GiveJoker) => (2, 0, 0, 0),
            Some(Action::Declare) if matches!(role, Some(Role::Waiter | Role::Dishwasher)) => {
                (3, 0, 0, 0)
            }
            Some(Action::Decline) => (2, 0, 0, 0),
            Some(Action::Pass | Action::Declare) | None => (1, 0, 0, 0),
        })
        .expect("a decision has a legal action")
}

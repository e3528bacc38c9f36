//! Pairs of games that differ only in which seats hold the jokers, and so in who may declare a
//! special action and keeps quiet or lets it run out. Random policies, clocks, paces, answers and
//! faults, the same in both games: everything sent to a viewer who holds no joker must be the same,
//! to the byte, and sent at the same time. Other pairs differ in whether somebody is offered a special
//! action at all, and takes time to decline it or lets it run out. The same comparison detects
//! deliberate leaks.

use std::time::Duration;

use chefshat_agents::AgentKind;
use chefshat_engine::{
    ActionId, BySeat, Cards, DecisionKind, PassScope, RuleSet, RuleSetSpec, Seat, Viewer,
};
use chefshat_room::journal::{Change, Fill, ParticipantKind};
use chefshat_room::policy::{AbortPolicy, KindClock, Policy};
use chefshat_room::testing::{Chance, OPEN, Table, dealt, ms, second_shift, with_jokers_at};
use chefshat_room::{ConnectionId, Core};
use prost::Message as _;

use super::hidden_tests::sent_since;
use crate::convert;

/// How many pairs are played, unless `CHEFSHAT_PAIRS` says another number.
const PAIRS: u64 = 3_000;

/// One of the two games, with what was compared so far.
struct World {
    table: Table,
    connections: Vec<ConnectionId>,
    /// Events compared.
    seen: usize,
    /// Entries of the journal read for `choices`.
    read: usize,
    /// The decisions whose actions others may learn, in order.
    choices: Vec<(Seat, ActionId)>,
}

impl World {
    fn new(table: Table) -> Self {
        Self {
            table,
            connections: Vec::new(),
            seen: 0,
            read: 0,
            choices: Vec::new(),
        }
    }

    fn start(&mut self, kinds: &[ParticipantKind]) {
        for kind in kinds {
            let _ = self.table.join(*kind);
        }
        for seat in self.table.core.all_seats() {
            let connection = match self.table.core.standing(seat).participant {
                Some(_) => self.table.attach(seat),
                None => ConnectionId(0),
            };
            self.connections.push(connection);
        }
        self.table.core.begin_if_all_built_in(self.table.now);
        self.table.commit();
    }

    /// Reads the new decisions from the journal. A declined special action is none.
    fn read_choices(&mut self) {
        let decline = self.table.core.header().rules.actions().decline();
        for entry in &self.table.journal[self.read..] {
            if let Change::Decided(decided) = &entry.change
                && decided.action != decline
            {
                self.choices.push((decided.seat, decided.action));
            }
        }
        self.read = self.table.journal.len();
    }

    /// The seat and kind of the decision that a participant is asked for.
    fn asked(&self) -> Option<(Seat, DecisionKind)> {
        let open = self.table.core.awaited()?;
        Some((open.decision.seat, open.decision.kind))
    }

    fn is_silent(&self) -> bool {
        matches!(self.asked(), Some((_, DecisionKind::SpecialAction)))
    }

    /// Answers after a time, unless the decision runs out before.
    fn answer_after(&mut self, time: Duration, action: u32) {
        let (seat, id) = self.table.open();
        self.table.pass_time(time);
        self.table.answer(seat, id, action);
    }

    /// Lets the open decision run out.
    fn run_out(&mut self) {
        let (left, bank) = self.table.core.time_left(self.table.now);
        self.table.pass_time(left + bank);
    }

    /// Lets the open decision run out while seats are away.
    fn run_out_without(&mut self, seats: [Seat; 2]) {
        let joined = |world: &Self, seat: Seat| world.connections[seat.index()] != ConnectionId(0);
        for seat in seats {
            if joined(self, seat) {
                self.lose(seat);
            }
        }
        self.run_out();
        for seat in seats {
            if joined(self, seat) {
                self.attach(seat);
            }
        }
    }

    fn lose(&mut self, seat: Seat) {
        self.table.lost(seat, self.connections[seat.index()]);
    }

    fn attach(&mut self, seat: Seat) {
        self.connections[seat.index()] = self.table.attach(seat);
    }

    /// Everything sent to a viewer since the last comparison, with its time.
    fn sent_to(&self, see: Viewer, leak: Leak) -> Vec<Vec<u8>> {
        let core = &self.table.core;
        let own = match see {
            Viewer::Seat(seat) => Some(seat),
            Viewer::Spectator | Viewer::Everything => None,
        };
        let mut messages = sent_since(self.seen, &self.table, own, see);
        let awaited = core.awaited_in_public();
        let awaited = awaited.filter(|it| see != Viewer::Seat(it.seat));
        messages.push(convert::awaited_to_proto(awaited, self.table.now).encode_to_vec());
        if see == Viewer::Spectator {
            messages.push(convert::describe_at(core, self.table.now).encode_to_vec());
        }
        messages.push(core.visible_to_spectators().to_be_bytes().to_vec());
        messages.push(leak(core).to_be_bytes().to_vec());
        messages
    }
}

/// Something of a room that every viewer would learn.
type Leak = fn(&Core) -> u128;

fn no_leak(_: &Core) -> u128 {
    0
}

/// What to play: everything that both games have in common.
struct Plan {
    rules: RuleSetSpec,
    policy: Policy,
    fills: Vec<Fill>,
    kinds: Vec<ParticipantKind>,
    /// The seats whose cards differ. Nobody else may notice.
    holders: [Seat; 2],
}

impl Plan {
    fn random(chance: &mut Chance) -> Self {
        let players = chance.pick(&[3, 4, 4, 4, 6]);
        let first = chance.index(players);
        let second = (first + 1 + chance.index(players - 1)) % players;
        let built_in = [
            Fill::BuiltIn(AgentKind::Greedy.into()),
            Fill::BuiltIn(AgentKind::Random.into()),
        ];
        let fills: Vec<Fill> = (0..players)
            .map(|_| match chance.below(4) {
                0 => chance.pick(&built_in),
                _ => OPEN,
            })
            .collect();
        let kinds = [
            ParticipantKind::Agent,
            ParticipantKind::Human,
            ParticipantKind::Robot,
        ];
        let clocks = match chance.below(2) {
            0 => Vec::new(),
            _ => vec![KindClock {
                kind: ParticipantKind::Human,
                decision_time: Some(ms(3000)),
                bank: Some(ms(chance.below(3) * 700)),
                absence_time: chance.pick(&[None, Some(ms(600))]),
            }],
        };
        Self {
            rules: RuleSetSpec {
                players: u8::try_from(players).expect("few players"),
                exchange: chance.below(4) > 0,
                pass_scope: chance.pick(&[PassScope::Pizza, PassScope::Turn]),
                ..RuleSetSpec::default()
            },
            policy: Policy {
                decision_time: ms(1000),
                bank: ms(chance.below(3) * 500),
                max_invalid_attempts: chance.pick(&[Some(1), Some(3), None]),
                max_timeouts: chance.pick(&[1, 2, 3]),
                substitute: chance.pick(&[AgentKind::Greedy, AgentKind::Random]).into(),
                abort: chance.pick(&[
                    AbortPolicy::Never,
                    AbortPolicy::Never,
                    AbortPolicy::AllLost,
                    AbortPolicy::AnyLost,
                ]),
                reward_scheme: chance.pick(&[None, Some(chefshat_engine::RewardScheme::Paper)]),
                pace: chance.pick(&[None, Some(ms(0)), Some(ms(300))]),
                spectator_delay_decisions: chance.index(4),
                clocks,
                absence_time: chance.pick(&[None, Some(ms(0)), Some(ms(400)), Some(ms(1000))]),
                ..Policy::default()
            },
            kinds: fills
                .iter()
                .filter(|fill| **fill == OPEN)
                .map(|_| chance.pick(&kinds))
                .collect(),
            fills,
            holders: [Seat::new(first), Seat::new(second)],
        }
    }

    fn world(&self, hands: BySeat<Cards>) -> World {
        let mut world = World::new(Table::scripted(
            self.policy.clone(),
            self.fills.clone(),
            self.rules.clone(),
            second_shift(hands),
        ));
        world.start(&self.kinds);
        world
    }

    /// Two games: in one the first seat holds both jokers, in the other the second seat holds them
    /// or each holds one. `None` if the deal has no such cards, or if forced gifts, which their
    /// receivers see, would differ.
    fn worlds(
        &self,
        rules: &RuleSet,
        others: [Seat; 2],
        chance: &mut Chance,
    ) -> Option<[World; 2]> {
        let seed = u8::try_from(chance.below(256)).expect("below 256");
        let hands = dealt(rules, seed, [self.holders[0]; 2])?;
        let twin = with_jokers_at(others, &hands, rules.faces())?;
        let rarest = |hands: &BySeat<Cards>| {
            let two = |seat| {
                hands[seat]
                    .ascending(rules.faces())
                    .take(2)
                    .collect::<Vec<_>>()
            };
            hands.seats().map(two).collect::<Vec<_>>()
        };
        (rarest(&hands) == rarest(&twin)).then(|| [self.world(hands), self.world(twin)])
    }

    fn viewers(&self) -> impl Iterator<Item = Viewer> + '_ {
        (0..self.fills.len())
            .map(Seat::new)
            .filter(|seat| !self.holders.contains(seat))
            .map(Viewer::Seat)
            .chain([Viewer::Spectator])
    }
}

/// Whether both games have made the same choices so far, as far as both have gone. Nobody has
/// declared a special action, which is public.
fn agree(worlds: &mut [World; 2]) -> bool {
    worlds.iter_mut().for_each(World::read_choices);
    let [one, other] = &*worlds;
    let declare = one.table.core.header().rules.actions().declare();
    let mut choices = one.choices.iter().chain(&other.choices);
    choices.all(|(_, action)| *action != declare)
        && one.choices.iter().zip(&other.choices).all(|(a, b)| a == b)
}

/// Compares what was sent since the last comparison to everybody but a seat.
fn compare(
    plan: &Plan,
    worlds: &mut [World; 2],
    except: Option<Seat>,
    leak: Leak,
) -> Result<usize, String> {
    let mut messages = 0;
    let except = except.map(Viewer::Seat);
    for see in plan.viewers().filter(|see| Some(*see) != except) {
        let [one, other] = [&worlds[0], &worlds[1]].map(|world| world.sent_to(see, leak));
        if one != other {
            let differing = one.iter().zip(&other).position(|(one, other)| one != other);
            let states = [&worlds[0], &worlds[1]].map(|world| {
                let log = world.table.core.log();
                let events: Vec<_> = log.since(world.seen).collect();
                format!(
                    "{:?} asks {:?} after {events:?}",
                    world.table.now,
                    world.asked()
                )
            });
            return Err(format!(
                "{see:?} sees a difference in message {differing:?} of {} or {}:\n{}",
                one.len(),
                other.len(),
                states.join("\n")
            ));
        }
        messages += one.len();
    }
    for world in worlds {
        world.seen = world.table.core.log().len();
    }
    Ok(messages)
}

/// Plays a pair until it ends, the choices of built-in agents differ, or another Shift starts.
/// Returns the number of messages compared.
fn play_pair(number: u64, leak: Leak) -> Result<usize, String> {
    let mut chance = Chance(number);
    let plan = Plan::random(&mut chance);
    let rules = plan.rules.validate().expect("a valid rule set");
    let [first, second] = plan.holders;
    let others = chance.pick(&[[second; 2], [second; 2], [first, second]]);
    let Some(mut worlds) = plan.worlds(&rules, others, &mut chance) else {
        return Ok(0);
    };
    let mut messages = 0;
    let decisions = chance.below(40);
    for _ in 0..decisions {
        if !agree(&mut worlds) {
            break;
        }
        // A silent decision in one game alone is taken in no time.
        if worlds[0].is_silent() == worlds[1].is_silent() {
            messages += compare(&plan, &mut worlds, None, leak)
                .map_err(|problem| format!("pair {number}: {problem}"))?;
        }
        let ended = |world: &World| {
            let core = &world.table.core;
            core.state().is_over() || core.game().is_none_or(|game| game.shift() > 2)
        };
        if worlds.iter().any(ended) {
            break;
        }
        step(&plan, &mut worlds, &mut chance);
    }
    Ok(messages)
}

/// Advances both games by the same inputs.
fn step(plan: &Plan, worlds: &mut [World; 2], chance: &mut Chance) {
    match [worlds[0].is_silent(), worlds[1].is_silent()] {
        [false, false] => {}
        // A silent decision takes time only if there is one in both games.
        [one, other] => {
            let (runs_out, time) = (one && other && chance.below(2) == 0, chance.below(900));
            // The seats that may hold the jokers are away, and return afterwards.
            let away = runs_out && chance.below(2) == 0;
            for world in worlds.iter_mut().filter(|world| world.is_silent()) {
                if away {
                    world.run_out_without(plan.holders);
                } else if runs_out {
                    world.run_out();
                } else {
                    let thinks = if one && other { ms(time) } else { ms(0) };
                    let decline = world.table.core.header().rules.actions().decline();
                    world.answer_after(thinks, decline.index().into());
                }
            }
            return;
        }
    }
    let asked = worlds[0].asked();
    if asked.is_none() || asked != worlds[1].asked() {
        // Built-in agents are next. Whatever happens first happens in both.
        let deadline = |world: &World| world.table.core.deadline();
        let next = worlds.iter().filter_map(deadline).min();
        for world in worlds {
            let left = next.map_or(ms(0), |next| next.saturating_sub(world.table.now));
            world.table.pass_time(left);
        }
        return;
    }
    let (seat, _) = asked.expect("a decision is open");
    let common: Vec<u32> = (worlds[0].table.core.legal_actions().iter())
        .filter(|action| worlds[1].table.core.legal_actions().contains(*action))
        .map(|action| action.index().into())
        .collect();
    let illegal = u32::from(worlds[0].table.core.header().rules.actions().size());
    let (what, time, pick) = (chance.below(12), ms(chance.below(900)), chance.draw());
    let other = Seat::new(chance.index(worlds[0].connections.len()));
    for world in worlds {
        match what {
            0 => world.run_out(),
            1 => {
                let attempts = world.table.core.attempts_left().unwrap_or(2);
                for _ in 0..attempts {
                    world.answer_after(ms(0), illegal);
                }
            }
            2 => {
                world.lose(seat);
                world.run_out();
                world.attach(seat);
            }
            3 => {
                world.lose(seat);
                world.table.pass_time(time);
                world.attach(seat);
            }
            4 if world.connections[other.index()] != ConnectionId(0) => {
                world.lose(other);
                world.attach(other);
            }
            _ => {
                match usize::try_from(pick)
                    .unwrap_or_default()
                    .checked_rem(common.len())
                {
                    Some(index) => world.answer_after(time, common[index]),
                    None => world.run_out(),
                }
            }
        }
    }
}

#[test]
fn nothing_that_is_sent_depends_on_a_silent_decision() {
    let pairs = std::env::var("CHEFSHAT_PAIRS")
        .map_or(PAIRS, |pairs| pairs.parse().expect("a number of pairs"));
    let messages: usize = (0..pairs)
        .map(|pair| play_pair(pair, no_leak).unwrap_or_else(|leak| panic!("{leak}")))
        .sum();
    let least = usize::try_from(pairs).expect("a number that fits") * 10;
    assert!(messages > least, "only {messages} messages were compared");
    println!("{pairs} pairs, {messages} messages");
}

/// Plays the start of a Shift in a pair of which in one game a participant is offered a special
/// action, and in the other nobody, a built-in agent or another participant. Each thinks before it
/// declines, or lets it run out. Where the phase has a fixed time, the first who gives is asked at the
/// same time; elsewhere it is not compared. Returns the number of messages compared.
fn play_offered(number: u64, leak: Leak) -> Result<usize, String> {
    let mut chance = Chance(number);
    let mut plan = Plan::random(&mut chance);
    plan.rules.exchange = true;
    let policy = &mut plan.policy;
    // No time runs out.
    policy.decision_time = ms(10_000);
    policy.clocks.iter_mut().for_each(|clock| {
        clock.decision_time = Some(ms(20_000));
        clock.absence_time = clock.absence_time.map(|_| ms(15_000));
    });
    policy.absence_time = policy.absence_time.map(|_| ms(9_000));
    policy.spectator_delay_decisions = 0;
    policy.pace = policy.pace.or(Some(ms(100)));
    let has_pace = policy.pace != Some(ms(0));
    let seats_of_participants = plan.fills.iter().filter(|fill| **fill == OPEN);
    let is_fixed = has_pace && seats_of_participants.count() > 1;
    let rules = plan.rules.validate().expect("a valid rule set");
    let others = match is_fixed {
        true => chance.pick(&[plan.holders, [plan.holders[1]; 2]]),
        false => plan.holders,
    };
    let Some(mut worlds) = plan.worlds(&rules, others, &mut chance) else {
        return Ok(0);
    };
    let awaited = |world: &World| world.table.core.awaited_in_public();
    let (offered, Some(giver)) = (worlds[0].is_silent(), awaited(&worlds[0])) else {
        return Ok(0);
    };
    // Without a fixed time, gifts of built-in agents show that nothing was offered.
    let gives = matches!(worlds[1].asked(), Some((_, DecisionKind::Exchange)));
    if !offered || !(gives || is_fixed) {
        return Ok(0);
    }
    let mut messages = 0;
    let latest = if is_fixed { 40 } else { 8 };
    let (declines, gives) = ([0; 2].map(|_| chance.index(latest)), 32 + chance.index(8));
    let except = Some(giver.seat).filter(|_| !is_fixed);
    let gift = chance.index(2);
    for tick in 0..45 {
        let seat = Seat::new(chance.index(plan.fills.len()));
        let (lost, found) = (chance.below(4) == 0, chance.below(4) == 0);
        for world in worlds.iter_mut() {
            let joined = world.connections[seat.index()] != ConnectionId(0);
            if lost && joined {
                world.lose(seat);
            } else if found && joined {
                world.attach(seat);
            }
        }
        for (world, declines) in worlds.iter_mut().zip(declines) {
            if tick == declines && world.is_silent() {
                let decline = world.table.core.header().rules.actions().decline();
                world.answer_after(ms(0), decline.index().into());
            }
        }
        let is_asked = |world: &World| world.asked() == Some((giver.seat, DecisionKind::Exchange));
        if tick == gives && worlds.iter().all(is_asked) {
            // One that is legal in both games: the giver may hold jokers.
            let [one, other] = [&worlds[0], &worlds[1]].map(|it| it.table.core.legal_actions());
            let both: Vec<ActionId> = one.iter().filter(|it| other.contains(*it)).collect();
            for world in worlds.iter_mut() {
                let (seat, id) = world.table.open();
                let action = both[gift % both.len()];
                world.table.answer(seat, id, action.index().into());
            }
        }
        // A built-in agent with another hand may have given other cards.
        if !agree(&mut worlds) {
            break;
        }
        messages += compare(&plan, &mut worlds, except, leak)
            .map_err(|problem| format!("pair {number}, tick {tick}: {problem}"))?;
        for world in worlds.iter_mut() {
            world.table.pass_time(ms(100));
        }
    }
    Ok(messages)
}

#[test]
fn nothing_that_is_sent_before_the_first_gift_shows_whether_a_special_action_is_offered() {
    let messages: usize = (0..2_000)
        .map(|pair| play_offered(pair, no_leak).unwrap_or_else(|leak| panic!("{leak}")))
        .sum();
    assert!(messages > 350_000, "only {messages} messages were compared");
    let asked: Leak = |core| (core.open()).map_or(0, |open| 1 + open.decision.seat.index() as u128);
    assert!((0..2_000).any(|pair| play_offered(pair, asked).is_err()));
}

#[test]
fn deliberate_leaks_are_detected() {
    let leaks: [(&str, Leak); 3] = [
        ("how many decisions were taken", |core| {
            core.decisions().into()
        }),
        ("who is asked now", |core| {
            core.open()
                .map_or(0, |open| 1 + open.decision.seat.index() as u128)
        }),
        ("how much is in the journal", |core| core.changes().into()),
    ];
    for (name, leak) in leaks {
        let detected = (0..200).any(|pair| play_pair(pair, leak).is_err());
        assert!(detected, "{name}");
    }
}

//! Sequences of events for tournament participants: what is attached when, which agent plays which
//! game, how it ends.

use super::*;

/// First handle of the seats that the server attaches.
const FIRST_HANDLE: u32 = 1 << 31;

type Logs = Arc<Mutex<Vec<(String, Arc<Mutex<Vec<String>>>)>>>;

/// A session of one participant, and the log of each game's agent, in the order of creation.
struct Cup {
    session: Session<'static, Scripted>,
    logs: Logs,
}

impl Cup {
    /// Every agent always answers with ten times the number of its game.
    fn new() -> Self {
        let logs = Logs::default();
        let making = Arc::clone(&logs);
        let make = move |attached: &v1::Attached| {
            let log = Arc::default();
            let mut logs = making.lock().unwrap();
            logs.push((attached.game_id.clone(), Arc::clone(&log)));
            let action = 10 * u32::try_from(logs.len()).unwrap();
            let actions = [action; 9].into();
            Scripted { log, actions }
        };
        let options = PlayOptions {
            entropy: Entropy::Fixed(vec![7]),
            ..PlayOptions::default()
        };
        let session = Session::of_participant("cup".to_owned(), make, &options);
        Self { session, logs }
    }

    /// One that has entered.
    fn entered() -> Self {
        let mut cup = Self::new();
        assert_eq!(cup.attach(), ["cup from 1"]);
        assert!(cup.receive(vec![(0, entered())]).is_empty());
        cup
    }

    /// A new stream: what is attached on it, in order.
    fn attach(&mut self) -> Vec<String> {
        let requests = self.session.attach().into_iter();
        let commands = requests.flat_map(|request| request.commands);
        commands
            .map(|command| match command.command {
                Some(Command::Attach(attach)) => {
                    assert_eq!(attach.entropy, [7]);
                    format!("{} from {}", attach.ticket, attach.from_sequence)
                }
                other => panic!("not an attachment: {other:?}"),
            })
            .collect()
    }

    fn receive(&mut self, updates: Vec<(u32, Update)>) -> Vec<String> {
        let requests = self.session.receive(response(updates));
        requests.iter().map(in_short).collect()
    }

    /// The logs of the agents since the last call, by game.
    fn new_lines(&self) -> Vec<(String, Vec<String>)> {
        let logs = self.logs.lock().unwrap();
        let lines = logs.iter().map(|(game, log)| {
            let lines = std::mem::take(&mut *log.lock().unwrap());
            (game.clone(), lines)
        });
        lines.filter(|(_, lines)| !lines.is_empty()).collect()
    }
}

fn entered() -> Update {
    Update::Entered(v1::Entered {
        request_id: PARTICIPANT,
        tournament_id: "tournament".to_owned(),
        participant: 3,
    })
}

/// The seat of a game, attached by the server (request id 0) or because it was asked for.
fn seated(request_id: u32, game: &str, seat: u32, next_sequence: u64) -> Update {
    Update::Attached(v1::Attached {
        request_id,
        room_id: format!("room of {game}"),
        game_id: game.to_owned(),
        seat,
        next_sequence,
        ticket: format!("ticket of {game}"),
        tournament_id: "tournament".to_owned(),
    })
}

fn refused(request_id: u32) -> Update {
    Update::Refused(v1::Refused {
        request_id,
        code: 16,
        reason: "TICKET_UNKNOWN".to_owned(),
        ..v1::Refused::default()
    })
}

fn over() -> Update {
    detached(v1::DetachReason::TournamentOver)
}

/// The results of the games, in short.
fn played(cup: Cup) -> Result<Vec<String>, String> {
    assert!(cup.session.is_over());
    match cup.session.into_played() {
        Ok(outcomes) => Ok(outcomes
            .into_iter()
            .map(|outcome| {
                let place = outcome.standing().map(|line| line.place);
                format!("{} {place:?}", outcome.game_id)
            })
            .collect()),
        Err(error) => Err(error.reason().unwrap_or("none").to_owned()),
    }
}

#[test]
fn a_seat_that_is_attached_twice_is_played_under_its_newest_handle() {
    let mut cup = Cup::entered();
    cup.receive(vec![(FIRST_HANDLE, seated(0, "a", 0, 1))]);
    assert_eq!(cup.attach(), ["ticket of a from 1", "cup from 1"]);
    // The server attaches it with the participant, before it gets to what the client asked for.
    let sent = cup.receive(vec![
        (1, entered()),
        (FIRST_HANDLE, seated(0, "a", 0, 1)),
        (0, seated(FIRST_SEAT, "a", 0, 1)),
        (FIRST_HANDLE, detached(v1::DetachReason::Superseded)),
        (0, decision(4)),
    ]);
    assert_eq!(sent, ["0:4=10"]);
    // A late refusal of one of its attachments takes nothing away.
    let sent = cup.receive(vec![(0, refused(FIRST_SEAT)), (0, decision(5))]);
    assert_eq!(sent, ["0:5=10"]);
}

#[test]
fn every_game_has_its_own_agent() {
    let mut cup = Cup::entered();
    let sent = cup.receive(vec![
        (FIRST_HANDLE, seated(0, "a", 0, 1)),
        (FIRST_HANDLE + 1, seated(0, "b", 1, 1)),
        (FIRST_HANDLE, events(&[(1, None)])),
        (FIRST_HANDLE + 1, decision(5)),
        (FIRST_HANDLE, decision(4)),
    ]);
    assert_eq!(
        sent,
        [format!("{}:5=20 {FIRST_HANDLE}:4=10", FIRST_HANDLE + 1)]
    );
    let lines = cup.new_lines();
    assert_eq!(lines[0].0, "a");
    assert_eq!(lines[0].1, ["attached 0", "event 1", "decide 4 None"]);
    assert_eq!(lines[1].0, "b");
    assert_eq!(lines[1].1, ["attached 1", "decide 5 None"]);
    let end = |seat| {
        let end = (seat, events(&[(2, ended())]));
        vec![end, (seat, detached(v1::DetachReason::GameOver))]
    };
    cup.receive(end(FIRST_HANDLE + 1));
    assert!(!cup.session.is_over());
    cup.receive(end(FIRST_HANDLE));
    assert!(!cup.session.is_over(), "there may be more games");
    cup.receive(vec![(0, over())]);
    assert_eq!(
        played(cup),
        Ok(vec!["a Some(2)".to_owned(), "b Some(1)".to_owned()])
    );
}

#[test]
fn a_new_stream_continues_with_the_same_agents() {
    let mut cup = Cup::entered();
    cup.receive(vec![
        (FIRST_HANDLE, seated(0, "a", 0, 1)),
        (FIRST_HANDLE + 1, seated(0, "b", 1, 1)),
        (FIRST_HANDLE, events(&[(1, None), (2, None)])),
        (FIRST_HANDLE, decision(4)),
    ]);
    cup.new_lines();
    cup.session.disconnected();
    let attached = cup.attach();
    assert_eq!(
        attached,
        ["ticket of a from 3", "ticket of b from 1", "cup from 1"]
    );
    let sent = cup.receive(vec![
        (0, seated(1, "a", 0, 4)),
        (1, seated(2, "b", 1, 1)),
        (2, entered()),
        (FIRST_HANDLE, seated(0, "c", 1, 1)),
        (0, events(&[(3, None)])),
        (0, decision(4)),
        (1, decision(1)),
        (FIRST_HANDLE, decision(2)),
    ]);
    assert_eq!(sent, [format!("0:4=10 1:1=20 {FIRST_HANDLE}:2=30")]);
    let lines: Vec<_> = cup
        .new_lines()
        .into_iter()
        .map(|(_, lines)| lines)
        .collect();
    assert_eq!(
        lines[0],
        ["attached 0", "event 3"],
        "asked for nothing, no event received twice"
    );
    assert_eq!(lines[1], ["attached 1", "decide 1 None"]);
    assert_eq!(lines[2], ["attached 1", "decide 2 None"]);
}

/// A server attaches a seat again that the client has attached already: the newest attachment wins.
#[test]
fn a_seat_attached_twice_is_one_seat() {
    let mut cup = Cup::entered();
    let sent = cup.receive(vec![
        (FIRST_HANDLE, seated(0, "a", 0, 1)),
        (FIRST_HANDLE, events(&[(1, None)])),
        (FIRST_HANDLE + 1, seated(0, "a", 0, 2)),
        (FIRST_HANDLE, detached(v1::DetachReason::Superseded)),
        (FIRST_HANDLE + 1, events(&[(1, None), (2, None)])),
        (FIRST_HANDLE + 1, decision(4)),
    ]);
    assert_eq!(sent, [format!("{}:4=10", FIRST_HANDLE + 1)]);
    let logs = cup.new_lines();
    assert_eq!(logs.len(), 1);
    let lines = [
        "attached 0",
        "event 1",
        "attached 0",
        "event 2",
        "decide 4 None",
    ];
    assert_eq!(logs[0].1, lines);
}

#[test]
fn a_game_that_ended_on_a_lost_connection_is_not_played_again() {
    let mut cup = Cup::entered();
    cup.receive(vec![
        (FIRST_HANDLE, seated(0, "a", 0, 1)),
        (FIRST_HANDLE, events(&[(1, ended())])),
    ]);
    cup.session.disconnected();
    cup.new_lines();
    assert_eq!(cup.attach(), ["cup from 1"]);
    let sent = cup.receive(vec![
        (0, entered()),
        (FIRST_HANDLE, seated(0, "a", 0, 1)),
        (FIRST_HANDLE, events(&[(1, ended())])),
        (FIRST_HANDLE + 1, seated(0, "b", 1, 1)),
        (FIRST_HANDLE + 1, decision(2)),
    ]);
    let other = FIRST_HANDLE + 1;
    assert_eq!(sent, [format!("{FIRST_HANDLE}:detach {other}:2=20")]);
    assert_eq!(cup.new_lines().len(), 1, "only the new game has an agent");
    cup.receive(vec![
        (FIRST_HANDLE, detached(v1::DetachReason::Requested)),
        (other, events(&[(1, ended())])),
        (other, detached(v1::DetachReason::GameOver)),
        (0, over()),
    ]);
    assert_eq!(
        played(cup),
        Ok(vec!["a Some(2)".to_owned(), "b Some(1)".to_owned()])
    );
}

#[test]
fn the_end_of_the_tournament_waits_for_open_games() {
    let mut cup = Cup::entered();
    let aborted = Kind::GameAborted(Box::new(v1::GameAborted {
        reason: v1::AbortReason::Closed.into(),
        reveal: None,
    }));
    cup.receive(vec![(FIRST_HANDLE, seated(0, "a", 0, 1)), (0, over())]);
    assert!(!cup.session.is_over());
    cup.session.disconnected();
    assert_eq!(
        cup.attach(),
        ["ticket of a from 1"],
        "nobody enters what is over"
    );
    cup.receive(vec![
        (0, seated(1, "a", 0, 2)),
        (0, events(&[(1, Some(aborted))])),
        (0, detached(v1::DetachReason::GameOver)),
    ]);
    assert_eq!(played(cup), Ok(vec!["a None".to_owned()]));
}

#[test]
fn a_game_without_a_room_has_no_outcome_and_does_not_stop_others() {
    let mut cup = Cup::entered();
    cup.receive(vec![(FIRST_HANDLE, seated(0, "a", 0, 1))]);
    cup.session.disconnected();
    assert_eq!(cup.attach().len(), 2);
    cup.receive(vec![
        (0, refused(1)),
        (1, entered()),
        (FIRST_HANDLE, seated(0, "b", 0, 1)),
        (FIRST_HANDLE, events(&[(1, ended())])),
        (FIRST_HANDLE, detached(v1::DetachReason::GameOver)),
        (1, over()),
    ]);
    assert_eq!(played(cup), Ok(vec!["b Some(2)".to_owned()]));
}

#[test]
fn each_participant_has_its_own_reason_to_leave() {
    let harness = [
        (refused(PARTICIPANT), "TICKET_UNKNOWN"),
        (detached(v1::DetachReason::Superseded), "SUPERSEDED"),
        (detached(v1::DetachReason::Requested), "DETACHED"),
    ];
    for (update, reason) in harness {
        let mut cup = Cup::entered();
        cup.receive(vec![(FIRST_HANDLE, seated(0, "a", 0, 1)), (0, update)]);
        assert!(!cup.session.is_over(), "its game may continue");
        cup.receive(vec![(FIRST_HANDLE, detached(v1::DetachReason::Superseded))]);
        assert_eq!(played(cup), Err(reason.to_owned()));
    }
    let mut cup = Cup::entered();
    cup.receive(vec![(FIRST_HANDLE, seated(0, "a", 0, 1))]);
    cup.session.give_up(&PlayError::Superseded);
    assert_eq!(played(cup), Err("SUPERSEDED".to_owned()));
}

#[test]
fn agents_of_finished_games_are_dropped() {
    let mut cup = Cup::entered();
    cup.receive(vec![(FIRST_HANDLE, seated(0, "a", 0, 1))]);
    let held = |cup: &Cup| Arc::strong_count(&cup.logs.lock().unwrap()[0].1);
    assert_eq!(held(&cup), 2);
    cup.receive(vec![
        (FIRST_HANDLE, events(&[(1, ended())])),
        (FIRST_HANDLE, detached(v1::DetachReason::GameOver)),
    ]);
    assert_eq!(held(&cup), 1);
}

#[test]
fn unexpected_updates_do_not_stop_a_participant() {
    let mut cup = Cup::entered();
    let sent = cup.receive(vec![
        (9, entered()),
        (0, entered()),
        (FIRST_HANDLE, decision(1)),
        (FIRST_HANDLE, detached(v1::DetachReason::GameOver)),
        (FIRST_HANDLE, seated(77, "a", 0, 1)),
        (FIRST_HANDLE, seated(0, "b", 0, 1)),
        (FIRST_HANDLE, decision(1)),
        (0, decision(1)),
    ]);
    assert_eq!(sent, [format!("{FIRST_HANDLE}:1=10")]);
    assert!(!cup.session.is_over());
    // The server seats only participants.
    let mut harness = Harness::seated(&[5]);
    let sent = harness.receive(vec![
        (FIRST_HANDLE, seated(0, "a", 0, 1)),
        (FIRST_HANDLE, decision(1)),
    ]);
    assert!(sent.is_empty());
}

#[test]
fn a_participants_ticket_is_not_a_seats() {
    let mut harness = Harness::new(&[&[]]);
    harness.session.attach();
    let entered = v1::Entered {
        request_id: FIRST_SEAT,
        ..v1::Entered::default()
    };
    let game = v1::Attached {
        game_id: "game".to_owned(),
        ..v1::Attached::default()
    };
    let sent = harness.receive(vec![
        (3, Update::Entered(entered)),
        (4, Update::Attached(game)),
        (3, detached(v1::DetachReason::Requested)),
    ]);
    assert_eq!(sent, ["3:detach"]);
    assert!(harness.session.is_over());
    let outcome = harness.session.into_outcomes().remove(0);
    let error = outcome.expect_err("it has no seat");
    assert_eq!(error.reason(), Some("TICKET_OF_PARTICIPANT"));
}

//! Draws the lobby, between the games of a tournament: the person's standing and next game, and the
//! standings.

use chefshat_client::v1;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Wrap};

use super::app::Link;
use super::lobby::{Lobby, Report};
use super::part::{Over, Part};
use crate::narration::{clean, columns};
use crate::tournament::tables::{Field, mean_score};
use crate::tournament::words::format_name;
use crate::tui::theme::{Theme, symbol};
use crate::tui::view::{is_too_small, padded, popup};

/// Rows of the person's box, with its frame.
const OWN_ROWS: u16 = 7;
/// Columns of a name.
const NAME: usize = 24;

const HELP: [&str; 9] = [
    "Each of your games starts here automatically; afterwards",
    "its result and then the standings are shown.",
    "",
    "PgUp PgDn  ↑ ↓   through the standings",
    "s                while you play: the standings; any key returns",
    "q                leave; your games wait for you for a while, then",
    "                 they are played without you",
    "",
    "any key returns",
];

/// Draws the lobby.
pub(super) fn draw(frame: &mut Frame<'_>, theme: Theme, part: &Part, lobby: &Lobby) {
    let area = frame.area();
    if is_too_small(frame) {
        return;
    }
    let [header, own, standings, said, keys] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(OWN_ROWS),
        Constraint::Min(1),
        Constraint::Length(1),
        Constraint::Length(1),
    ])
    .areas(area);
    draw_header(frame, theme, part, lobby, header);
    draw_own(frame, theme, part, lobby, own);
    draw_standings(frame, theme, lobby, standings);
    let (words, style) = match &part.link {
        Link::Over(Some(why)) if !lobby.is_over() => (
            format!(" ! Your place is lost: {why}. q ends."),
            theme.warning(),
        ),
        _ if part.is_over() && !part.peek => (" q ends.".to_owned(), theme.bold()),
        Link::Lost(why) => (
            format!(" Connection lost, reconnecting: {why}"),
            theme.warning(),
        ),
        _ if !lobby.notice.is_empty() => (format!(" ! {}", lobby.notice), theme.warning()),
        _ if part.peek => (
            " Your game continues. Any key returns to it.".to_owned(),
            theme.bold(),
        ),
        _ if lobby.has_games_to_come() => (
            " Your next game starts here automatically.".to_owned(),
            theme.bold(),
        ),
        _ => (
            " You have no more games. Stay until the end, or leave with q.".to_owned(),
            theme.bold(),
        ),
    };
    frame.render_widget(Paragraph::new(words).style(style), said);
    let words = " ↑↓ PgUp PgDn standings  ? help  q leave";
    frame.render_widget(Paragraph::new(words).style(theme.dim()), keys);
}

/// Draws the dialogs over lobby and games.
pub(super) fn draw_over(frame: &mut Frame<'_>, theme: Theme, part: &Part) {
    match part.over {
        Some(Over::Help) => {
            let lines = HELP.iter().map(|line| Line::from(*line)).collect();
            popup(frame, theme, "help", lines);
        }
        Some(Over::Leave) => popup(frame, theme, "leave", leaving(part)),
        None => {}
    }
}

/// Explains the consequences of leaving.
fn leaving(part: &Part) -> Vec<Line<'static>> {
    let report = part.lobby.as_ref().and_then(|it| it.report.as_ref());
    let settings = report.and_then(|it| it.tournament.settings.as_ref());
    let mut lines = vec!["Leave the tournament? You still have games to play.".to_owned()];
    if let Some(settings) = settings {
        let seconds = settings.no_show_time_ms.div_ceil(1000);
        lines.push(format!(
            "Each waits {seconds} s for you, at most {} times; then you forfeit it.",
            settings.max_calls
        ));
    }
    lines.push("When you leave, a ticket is printed; resume with it.".to_owned());
    lines.push(String::new());
    lines.push("y: leave; any other key: stay".to_owned());
    lines.into_iter().map(Line::from).collect()
}

fn draw_header(frame: &mut Frame<'_>, theme: Theme, part: &Part, lobby: &Lobby, area: Rect) {
    let mut words = " Chef's Hat".to_owned();
    if let Some(report) = &lobby.report {
        let tournament = &report.tournament;
        let settings = tournament.settings.clone().unwrap_or_default();
        words.push_str(&format!(
            " · {} · {}",
            clean(&settings.name, 30),
            format_name(report.format())
        ));
        if tournament.round > 0 {
            words.push_str(&format!(
                " · round {} of {}",
                tournament.round, tournament.rounds
            ));
        }
    }
    let status = part.link.words();
    let width = usize::from(area.width).saturating_sub(columns(status) + 1);
    let line = Line::from(format!("{}{status} ", padded(&words, width)));
    frame.render_widget(Paragraph::new(line).style(theme.header()), area);
}

fn draw_own(frame: &mut Frame<'_>, theme: Theme, part: &Part, lobby: &Lobby, area: Rect) {
    let ended = matches!(part.link, Link::Over(None));
    let words = lobby.words(ended).into_iter();
    let mut lines: Vec<Line<'_>> = words.map(|words| Line::from(format!(" {words}"))).collect();
    if let Some(first) = lines.first_mut() {
        *first = first.clone().patch_style(theme.bold());
    }
    let block = theme.boxed(" your tournament ");
    let own = Paragraph::new(lines).wrap(Wrap { trim: false });
    frame.render_widget(own.block(block), area);
}

fn draw_standings(frame: &mut Frame<'_>, theme: Theme, lobby: &Lobby, area: Rect) {
    let Some(report) = &lobby.report else {
        frame.render_widget(theme.boxed(" standings "), area);
        return;
    };
    let tournament = &report.tournament;
    let title = match (report.is_over(), tournament.games) {
        (true, _) => " final standings ".to_owned(),
        _ if tournament.state() == v1::TournamentState::Open => " participants ".to_owned(),
        (false, 0) => " standings ".to_owned(),
        (false, games) => format!(
            " standings · {} of {games} games over ",
            tournament.games_over
        ),
    };
    let rows = usize::from(area.height.saturating_sub(3));
    let count = report.standings.len();
    let most = count.saturating_sub(rows);
    let mine = report
        .standings
        .iter()
        .position(|it| it.participant == lobby.me);
    // The person's line is centred until they scroll.
    let first = lobby
        .first
        .unwrap_or_else(|| mine.unwrap_or(0).saturating_sub(rows / 2));
    let first = first.min(most);
    let knockout = report.format() == v1::TournamentFormat::Knockout;
    let last = if knockout { "last round" } else { "byes" };
    let heading = format!(
        "       {} what      games  a game  won  {last}",
        padded("name", NAME)
    );
    let mut lines = vec![Line::from(Span::styled(heading, theme.dim()))];
    let shown = report.standings.iter().skip(first).take(rows);
    lines.extend(shown.map(|standing| line(theme, lobby, report, standing)));
    let mut block = theme.boxed(title);
    if most > 0 {
        let to = (first + rows).min(count);
        block = block.title_bottom(format!(" {}–{to} of {count} ", first + 1));
    }
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn line(
    theme: Theme,
    lobby: &Lobby,
    report: &Report,
    standing: &v1::TournamentStanding,
) -> Line<'static> {
    let field = Field::new(&report.tournament);
    let who = field.get(standing.participant);
    let (mark, word) = symbol(who.map_or(v1::ParticipantKind::Agent, |it| it.kind()));
    let word = if who.is_some_and(|it| it.filler) {
        "filler"
    } else {
        word
    };
    let mine = standing.participant == lobby.me;
    let name = match mine {
        true => format!("{} (you)", field.name(standing.participant)),
        false => field.name(standing.participant),
    };
    let here = who.is_none_or(|it| it.connected || !it.built_in_agent.is_empty());
    let knockout = report.format() == v1::TournamentFormat::Knockout;
    let last = if knockout {
        standing.last_round
    } else {
        standing.byes
    };
    let first = standing.places.first().copied().unwrap_or(0);
    let words = format!(
        "{} {:>4}  {} {mark} {word:<7} {:>5}  {:>6}  {first:>3}  {last:>4}{}",
        if mine { "▶" } else { " " },
        match standing.place {
            0 => "–".to_owned(),
            place => place.to_string(),
        },
        padded(&name, NAME),
        standing.games,
        format!("{:.2}", mean_score(standing)),
        if here || report.is_over() {
            ""
        } else {
            "  not here"
        },
    );
    let style = if mine {
        theme.bold()
    } else {
        ratatui::style::Style::new()
    };
    Line::from(Span::styled(words, style))
}

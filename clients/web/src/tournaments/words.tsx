// A tournament in words: format, state, how it is played.

import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import {
  type Tournament,
  TournamentDeals,
  TournamentFormat,
  type TournamentSettings,
  TournamentState,
} from "../gen/chefshat/v1/tournament_pb";
import { dateOf, momentOf, t } from "../i18n";
import { clockOfPeople, visibilityWords } from "../lobby/rooms";
import { StateChip } from "../parts/StateChip";
import { joinedIn } from "./structure";

/** The state of a tournament. */
export function TournamentStateChip({ tournament }: { tournament: Tournament }) {
  const words = t().tournaments.states;
  switch (tournament.state) {
    case TournamentState.OPEN:
      return <StateChip state="open" word={words.open} />;
    case TournamentState.PLAYING:
      return tournament.paused ? (
        <StateChip state="paused" word={words.paused} />
      ) : (
        <StateChip state="playing" word={words.playing} />
      );
    case TournamentState.FINISHED:
      return <StateChip state="finished" word={words.finished} />;
    default:
      return <StateChip state="ended" word={words.closed} />;
  }
}

/** Format, size and progress, in one line. */
export function inShort(tournament: Tournament): string {
  const words = t().tournaments;
  const parts = [formatWord(tournament)];
  const joined = joinedIn(tournament).length;
  if (joined > 0) parts.push(words.participants(joined));
  if (tournament.state === TournamentState.PLAYING) parts.push(words.roundOf(tournament.round, tournament.rounds));
  if (tournament.state !== TournamentState.OPEN) parts.push(words.gamesOver(tournament.gamesOver, tournament.games));
  return [...parts, ...visibilityWords(tournament.settings?.policy)].join(" · ");
}

/** When it was created: tournaments may have the same name. */
export function madeWords({ createdAtMs }: Tournament): string {
  return t().tournaments.made(momentOf(createdAtMs));
}

/** The day of a tournament that has begun: for which its start was planned, else on which it was created. */
export function dayWords({ createdAtMs, settings }: Tournament): string {
  const { startAtMs = 0n } = settings ?? {};
  // It may have started earlier than planned.
  return dateOf(startAtMs > createdAtMs && startAtMs <= BigInt(Date.now()) ? startAtMs : createdAtMs);
}

/** When it starts, before the start. */
function startWords({ startAtMs, startWhenJoined }: TournamentSettings): string {
  const words = t().tournaments.play;
  if (startAtMs === 0n) return startWhenJoined ? words.beginsAt(startWhenJoined) : words.beginsByHand;
  const at = momentOf(startAtMs);
  return startWhenJoined ? words.beginsAtOrOn(startWhenJoined, at) : words.beginsOn(at);
}

/**
 * How it will be played, as far as known before the start: when it starts, how many games, how much
 * time people have.
 */
export function playWords(tournament: Tournament): string[] {
  const { settings } = tournament;
  return settings ? [startWords(settings), ...settingsWords(tournament)] : [];
}

/** How many games, and how much time people have. */
export function settingsWords(tournament: Tournament): string[] {
  const words = t().tournaments.play;
  const { settings } = tournament;
  if (!settings) return [];
  const parts: string[] = [];
  if (settings.format === TournamentFormat.KNOCKOUT) parts.push(words.knockout(settings.gamesPerPairing));
  else parts.push(words.rounds(settings.rounds, settings.gamesPerPairing));
  const stop = settings.rules?.stop;
  if (stop?.case === "targetPoints") parts.push(words.toPoints(stop.value));
  if (stop?.case === "targetShifts") parts.push(words.shifts(stop.value));
  if (settings.policy && isForPeople(tournament)) {
    const { decisionTimeMs, bankMs } = clockOfPeople(settings.policy);
    parts.push(words.clock(decisionTimeMs, bankMs));
  }
  return parts;
}

/** Whether people may join: with rotated deals only stateless agents may. */
export function isForPeople({ settings }: Tournament): boolean {
  const kinds = settings?.kinds ?? [];
  if (settings?.deals === TournamentDeals.ROTATED) return false;
  return kinds.length === 0 || kinds.includes(ParticipantKind.HUMAN);
}

/** Whether agents may join. */
export function isForAgents({ settings }: Tournament): boolean {
  const kinds = settings?.kinds ?? [];
  return kinds.length === 0 || kinds.includes(ParticipantKind.AGENT);
}

/** What is special about the deals; undefined if every game is dealt anew. */
export function dealsWords(tournament: Tournament): string | undefined {
  const words = t().tournaments.deals;
  switch (tournament.settings?.deals) {
    case TournamentDeals.SAME_AT_ALL_TABLES:
      return words.same;
    case TournamentDeals.ROTATED:
      return words.rotated;
    default:
      return undefined;
  }
}

/** The format in a word. */
export function formatWord(tournament: Tournament): string {
  const words = t().tournaments.formats;
  switch (tournament.settings?.format) {
    case TournamentFormat.ROUND_ROBIN:
      return words.roundRobin;
    case TournamentFormat.SWISS:
      return words.swiss;
    default:
      return words.knockout;
  }
}

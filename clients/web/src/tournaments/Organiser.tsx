// The organiser's part of a tournament's page: inviting, adding those at physical tables, starting,
// attending to physical games, changing it by hand, closing.

import { tournamentApi } from "../api/client";
import { agentsFor, useOffered } from "../api/server";
import { type Tournament, TournamentFormat, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { Invite } from "../lobby/Invite";
import { ActionButton } from "../parts/ActionButton";
import { ConfirmButton } from "../parts/ConfirmButton";
import { AddAtTable } from "./AddAtTable";
import { ManageGames, ManageParticipants, Pause } from "./ByHand";
import type { LiveTournament } from "./following";
import { hostedTournament, invitationTo, ownership } from "./hosting";
import { PhysicalGames } from "./PhysicalGames";
import { isEnded, joinedIn } from "./structure";
import css from "./Tournaments.module.css";
import { isForAgents } from "./words";

/** The organiser's part; null on other devices, and after the end. */
export function Organiser({ live }: { live: LiveTournament }) {
  const { tournament, games } = live;
  const { tournamentId, state } = tournament;
  const { offered } = useOffered();
  const real = (tournament.settings?.physicalTables ?? 0) > 0;
  const agents = offered ? agentsFor(offered, real, "") : [];
  const hosted = hostedTournament(tournamentId);
  if (!hosted || isEnded(tournament)) return null;
  const words = t().organise.own;
  const open = state === TournamentState.OPEN;
  const close = () => tournamentApi.closeTournament(ownership(tournamentId));
  const address = invitationTo(tournamentId, hosted.joinCode);
  const command = `chefshat tournament join --agent greedy --name Gustav --server ${location.origin} --code ${hosted.joinCode}`;
  return (
    <section class={`sheet ${css.organiser}`} data-part="organiser">
      <header>
        <h2>{words.title}</h2>
        <p class="soft small">{words.text}</p>
      </header>
      {open && <Begin tournament={tournament} />}
      {open && tournament.settings?.physicalTables ? <AddAtTable tournamentId={tournamentId} /> : null}
      {open && (
        <Invite
          title={words.invite}
          code={hosted.joinCode}
          address={address}
          agent={isForAgents(tournament) ? { label: t().lobby.invite.agent, command } : undefined}
        />
      )}
      {state === TournamentState.PLAYING && <Pause tournament={tournament} />}
      <PhysicalGames tournament={tournament} games={games} />
      <ManageParticipants tournament={tournament} agents={agents} />
      {state === TournamentState.PLAYING && <ManageGames live={live} />}
      <ConfirmButton label={words.close} confirm={words.closeDo} act={close}>
        {open ? words.closeOpen : words.closePlaying}
      </ConfirmButton>
    </section>
  );
}

/** Starts the tournament, and says what follows. */
function Begin({ tournament }: { tournament: Tournament }) {
  const { tournamentId, settings } = tournament;
  const words = t().organise.own;
  const joined = joinedIn(tournament).length;
  const field = fieldFor(tournament);
  return (
    <div class={css.organiserBegin}>
      <p>
        <b>{words.joined(joined)}</b> {settings?.startWhenJoined ? words.startsAt(settings.startWhenJoined) : null}{" "}
        {field > joined && joined > 1 && words.filledUp(field, settings?.filler ?? "", field - joined)}
      </p>
      <p class="soft small">{words.startText}</p>
      <ActionButton act={() => tournamentApi.startTournament(ownership(tournamentId))}>{words.start}</ActionButton>
    </div>
  );
}

/** Number of participants after state up: a knockout to a power of two, others to one table. */
export function fieldFor(tournament: Tournament): number {
  const { settings } = tournament;
  const joined = joinedIn(tournament).length;
  const table = settings?.rules?.players ?? 4;
  if (settings?.format !== TournamentFormat.KNOCKOUT) return Math.max(joined, table);
  return Math.max(table, 2 ** Math.ceil(Math.log2(Math.max(1, joined))));
}

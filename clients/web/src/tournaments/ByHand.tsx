// The organiser's changes of a tournament by hand: pausing, and for each participant and game what
// can be done about it.

import { useState } from "preact/hooks";
import { tournamentApi } from "../api/client";
import {
  type Tournament,
  type TournamentGame,
  TournamentGameState,
  TournamentState,
} from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { CopyLine } from "../lobby/Invite";
import { MAX_NAME } from "../lobby/room-form";
import { Submit } from "../parts/ActionButton";
import { useAttempt } from "../parts/attempt";
import { Button } from "../parts/Button";
import { ConfirmButton } from "../parts/ConfirmButton";
import { SelectField, TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import css from "./ByHand.module.css";
import { type LiveTournament, useGames } from "./following";
import { dismissPlaceLink, ownership, placeLinks, removeParticipant, replaceByAgent, replaceByPerson } from "./hosting";
import { type HeldPlace, linkToPlace } from "./place";
import { joinedIn, nameOf } from "./structure";

/** Pauses or resumes the tournament, and says what that means. */
export function Pause({ tournament }: { tournament: Tournament }) {
  const { tournamentId, paused } = tournament;
  const words = t().organise.own.pause;
  const { busy, fault, run } = useAttempt();
  const act = async () => {
    const change = paused ? tournamentApi.resumeTournament : tournamentApi.pauseTournament;
    await change(ownership(tournamentId));
    return false;
  };
  return (
    <div class={css.part} data-part="pause">
      {paused && <Notice kind="hint">{words.isPaused}</Notice>}
      <div class={css.row}>
        <Button look={paused ? "main" : "plain"} busy={busy} onClick={() => run(act)}>
          {paused ? words.resume : words.pause}
        </Button>
        {!paused && <span class="soft small">{words.text}</span>}
      </div>
      {fault && <Notice kind="fault">{fault}</Notice>}
    </div>
  );
}

/** The participants, each with what can be done about it. */
export function ManageParticipants({ tournament, agents }: { tournament: Tournament; agents: readonly string[] }) {
  const words = t().organise.own.people;
  const listed = joinedIn(tournament);
  const [links, setLinks] = useState(() => placeLinks(tournament.tournamentId));
  const renew = () => setLinks(placeLinks(tournament.tournamentId));
  if (listed.length === 0) return null;
  return (
    <details class={css.part} data-part="manage-participants" open={links.length > 0 || undefined}>
      <summary>{words.title}</summary>
      {links.map((held) => (
        <PlaceLink key={held.ticket} {...{ tournament, held, renew }} />
      ))}
      <ul class={css.list}>
        {listed.map(({ participant, withdrawn, filler, former }) => (
          <li key={participant}>
            <div>
              <b>{nameOf(tournament, participant)}</b>
              {withdrawn && <span class="soft small"> {t().tournaments.standings.withdrawn}</span>}
              {former.length > 0 && (
                <span class="soft small">
                  {" "}
                  {t().tournaments.standings.former(former.map(({ name }) => name).join(", "))}
                </span>
              )}
            </div>
            <details class={css.change}>
              <summary>
                {words.change}
                <span class="visually-hidden"> {nameOf(tournament, participant)}</span>
              </summary>
              {!withdrawn && !filler && <Remove {...{ tournament, participant, renew }} />}
              <Replace key={nameOf(tournament, participant)} {...{ tournament, participant, agents, renew }} />
            </details>
          </li>
        ))}
      </ul>
    </details>
  );
}

interface PlaceLinkProps {
  tournament: Tournament;
  held: HeldPlace;
  renew: () => void;
}

/** The link of a person who replaces another one, until the organiser has passed it on. */
function PlaceLink({ tournament: { tournamentId }, held, renew }: PlaceLinkProps) {
  const words = t().organise.own.people;
  const dismiss = () => {
    dismissPlaceLink(tournamentId, held.ticket);
    renew();
  };
  return (
    <Notice kind="good">
      {words.linkFor(held.name)}
      <CopyLine label={t().lobby.moving.link} text={linkToPlace(tournamentId, held)} />
      <Button look="quiet" onClick={dismiss}>
        {words.linkSent}
        <span class="visually-hidden"> ({held.name})</span>
      </Button>
    </Notice>
  );
}

interface ChangeProps {
  tournament: Tournament;
  participant: number;
  /** After a change, the links to pass on may be others. */
  renew: () => void;
}

/** Removes a participant, by the name that the question showed. */
function Remove({ tournament, participant, renew }: ChangeProps) {
  const { tournamentId, state } = tournament;
  const words = t().organise.own.people;
  const name = nameOf(tournament, participant);
  const remove = async () => {
    await removeParticipant(tournamentId, participant);
    renew();
    return false;
  };
  return (
    <ConfirmButton label={words.remove} confirm={words.removeDo} subject={name} act={remove}>
      {state === TournamentState.OPEN ? words.removeOpen(name) : words.removePlaying(name)}
    </ConfirmButton>
  );
}

/** Gives the place of a participant to a built-in agent or to another person. */
function Replace({ tournament, participant, agents, renew }: ChangeProps & { agents: readonly string[] }) {
  const words = t().organise.own.people;
  const { tournamentId } = tournament;
  const [by, setBy] = useState("");
  const [name, setName] = useState("");
  const [tried, setTried] = useState(false);
  const { busy, fault, run } = useAttempt();
  const replace = (event: Event) => {
    event.preventDefault();
    setTried(true);
    if (by === "" && name.trim() === "") return;
    run(async () => {
      if (by === "") await replaceByPerson(tournamentId, participant, name);
      else await replaceByAgent(tournamentId, participant, by);
      renew();
      setName("");
      setTried(false);
      return false;
    });
  };
  return (
    <form class={css.form} onSubmit={replace}>
      <SelectField
        label={words.replace}
        value={by}
        options={[
          { value: "", label: words.somebody },
          ...agents.map((value) => ({ value, label: words.agent(value) })),
        ]}
        onPick={setBy}
      />
      {by === "" && (
        <TextField
          label={words.newName}
          value={name}
          onText={setName}
          maxLength={MAX_NAME}
          fault={tried && name.trim() === "" ? t().organise.problems.nameMissing : undefined}
        />
      )}
      <Submit look="plain" {...{ busy, fault }}>
        {words.replaceDo}
      </Submit>
    </form>
  );
}

/** The games that are due or void, each with what can be done about it; null without one. */
export function ManageGames({ live }: { live: LiveTournament }) {
  const { tournament } = live;
  const words = t().organise.own.games;
  const changeable = useGames(live).filter(
    ({ state }) => state === TournamentGameState.DUE || state === TournamentGameState.VOID,
  );
  if (changeable.length === 0) return null;
  return (
    <details class={css.part} data-part="manage-games">
      <summary>{words.title}</summary>
      <p class="soft small">{words.text}</p>
      <ul class={css.list}>
        {changeable.slice(0, MAX_LISTED).map((game) => (
          <Game key={game.game} tournament={tournament} game={game} />
        ))}
      </ul>
      {changeable.length > MAX_LISTED && <p class="soft small">{words.more(changeable.length - MAX_LISTED)}</p>}
    </details>
  );
}

/** Most games listed. */
const MAX_LISTED = 50;

function Game({ tournament, game }: { tournament: Tournament; game: TournamentGame }) {
  const { tournamentId } = tournament;
  const words = t().organise.own.games;
  const { round, table, games } = t().tournaments;
  const { busy, fault, run } = useAttempt();
  const isDue = game.state === TournamentGameState.DUE;
  const request = { ...ownership(tournamentId), game: game.game };
  const act = (change: typeof tournamentApi.callGame | typeof tournamentApi.postponeGame) =>
    run(() => change(request).then(() => false));
  const names = game.seats.map(({ participant }) => nameOf(tournament, participant));
  return (
    <li>
      <div>
        <b>{games.of(`${round(game.round)}, ${table(game.table)}`, game.number)}</b>{" "}
        <span class="soft small">
          {names.join(", ")} · {isDue ? games.due : games.void}
        </span>
      </div>
      <div class={css.row}>
        <Button busy={busy} onClick={() => act(tournamentApi.callGame)}>
          {words.call}
        </Button>
        {isDue && (
          <Button look="quiet" busy={busy} onClick={() => act(tournamentApi.postponeGame)}>
            {words.postpone}
          </Button>
        )}
      </div>
      {fault && <Notice kind="fault">{fault}</Notice>}
    </li>
  );
}

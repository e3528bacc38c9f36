// The page of an invitation: enter a name and take a seat. A device that has a seat in the room
// goes straight to it.

import { useEffect, useState } from "preact/hooks";
import { faultOf, isPassing, needsToken, wordsOf } from "../api/faults";
import { usePolled } from "../api/poll";
import { ParticipantKind, type Room, RoomState } from "../gen/chefshat/v1/room_pb";
import { languageOf, t } from "../i18n";
import { NO_KEY } from "../name-key";
import { Submit } from "../parts/ActionButton";
import { useAttempt } from "../parts/attempt";
import { ButtonLink } from "../parts/Button";
import { TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { navigate, navigateFromHere, type PageProps, pathOf, type Route } from "../router";
import { heldPlace, takePlace } from "../tournaments/place";
import { paceOf, storePace } from "../wizard/pace";
import { lookUp } from "./code";
import css from "./Join.module.css";
import { JoinForm } from "./JoinForm";
import { rulesInShort } from "./RoomCard";
import { MAX_NAME } from "./room-form";
import { isOpen, nameOf } from "./rooms";
import { Seats } from "./Seats";
import { canonical, lastName, roomOfCode, takeSeat } from "./seat";

/** Polling interval of the code and its room, milliseconds. */
const EVERY_MS = 4_000;

/** The page. */
export function Join({ route }: PageProps<"join">) {
  const words = t().lobby.join;
  const code = canonical(route.code);
  const seated = code === "" ? null : roomOfCode(code);
  useEffect(() => {
    if (seated) navigate({ page: "room", roomId: seated }, { replace: true, search: languageOf(location.search) });
  }, [seated]);
  if (seated) return null;
  return (
    <section class={`sheet ${css.page}`}>
      <h1>{words.title}</h1>
      {code === "" ? <JoinForm /> : <WayIn code={code} />}
    </section>
  );
}

/** The room behind the code and the form to join it, or why it cannot be joined. */
function WayIn({ code }: { code: string }) {
  const words = t().lobby.join;
  const { value: found, fault } = usePolled((signal) => lookUp(code, signal), EVERY_MS, code);
  if (fault?.reason === "JOIN_CODE_WRONG") {
    return (
      <>
        <p>
          {words.code} <span class={css.code}>{code}</span>
        </p>
        <Notice kind="fault">{wordsOf(fault)}</Notice>
        <JoinForm />
      </>
    );
  }
  if (!found && fault && (needsToken(fault) || fault.reason === "TOO_MANY_WRONG_CODES")) {
    return <Notice kind="fault">{wordsOf(fault)}</Notice>;
  }
  if (found?.kind === "tournament") return <ToTournament tournamentId={found.tournamentId} code={code} />;
  if (!found && !fault) return <p class="soft">{t().common.loading}</p>;
  const room = found?.room;
  return (
    <>
      {room && (
        <section class={css.room} data-part="join-room">
          <h2>{room.name || t().lobby.rooms.unnamed}</h2>
          <p class="soft small">{rulesInShort(room)}</p>
          <Seats room={room} />
        </section>
      )}
      {room && !isOpen(room) ? <NoSeat room={room} /> : <NameForm code={code} room={room} />}
    </>
  );
}

/** Why nobody can sit down any more, and the way to watch. */
function NoSeat({ room }: { room: Room }) {
  const reasons = t().faults.byReason;
  const begun = room.state === RoomState.PLAYING ? reasons.GAME_STARTED : reasons.GAME_OVER;
  return (
    <>
      <Notice kind="hint">{room.state === RoomState.WAITING ? reasons.ROOM_FULL : begun}</Notice>
      {room.policy?.spectators && (
        <p>
          <ButtonLink look="main" href={pathOf({ page: "watch", roomId: room.roomId })}>
            {t().lobby.rooms.watch}
          </ButtonLink>
        </p>
      )}
    </>
  );
}

/**
 * Redirects to the page of the tournament with this code, which finds an existing place of this
 * device.
 */
function ToTournament({ tournamentId, code }: { tournamentId: string; code: string }) {
  useEffect(() => {
    const search = new URLSearchParams(location.search);
    search.set("code", code);
    navigate({ page: "tournament", tournamentId }, { replace: true, search: `?${search}` });
  }, [tournamentId]);
  return <p class="soft">{t().common.loading}</p>;
}

interface NameFormProps {
  code: string;
  /** The room behind the code, if known: for the names already taken. */
  room?: Room | undefined;
}

/** Asks for a name and takes a seat with the code. */
export function NameForm({ code, room }: NameFormProps) {
  const words = t().lobby.join;
  const [name, setName] = useState(lastName());
  const { busy, fault, run } = useAttempt();
  const [missing, setMissing] = useState(false);
  const forRobots = room?.seats.some(({ kind, name, reservedFor }) => {
    return name === "" && kind === ParticipantKind.UNSPECIFIED && reservedFor === ParticipantKind.ROBOT;
  });
  const [asRobot, setAsRobot] = useState(() => new URLSearchParams(location.search).get("as") === "robot");
  // The name of the last request without an answer, which may have taken the seat with this name.
  const [unanswered, setUnanswered] = useState("");
  const taken = unanswered !== name && (room?.seats.some((seat) => sameName(nameOf(seat), name)) ?? false);
  const join = (event: Event) => {
    event.preventDefault();
    setMissing(name.trim() === "");
    if (name.trim() === "" || taken) return;
    const pace = paceOf(new URLSearchParams(location.search).get("think") ?? "");
    if (asRobot && pace) storePace(pace);
    const navigate = navigateFromHere();
    run(async () => {
      try {
        navigate(await comeIn(code, name, asRobot));
      } catch (thrown) {
        if (isPassing(faultOf(thrown))) setUnanswered(name);
        throw thrown;
      }
    });
  };
  return (
    <form class={css.form} onSubmit={join}>
      <p>
        {words.code} <span class={css.code}>{code}</span>
      </p>
      <TextField
        label={words.name}
        hint={words.nameHint}
        value={name}
        onText={setName}
        fault={taken ? words.nameTaken(name.trim()) : missing ? words.nameMissing : undefined}
        maxLength={MAX_NAME}
        autoComplete="nickname"
      />
      {(asRobot || forRobots) && (
        <label class={css.asRobot} data-part="as-robot">
          <input type="checkbox" checked={asRobot} onInput={(event) => setAsRobot(event.currentTarget.checked)} />
          <span>
            {t().wizard.asRobot}
            <span class="soft small">{t().wizard.asRobotHint}</span>
          </span>
        </label>
      )}
      <Submit {...{ busy, fault }}>{words.sitDown}</Submit>
    </form>
  );
}

/** Whether two names look the same at the table. */
function sameName(one: string, other: string): boolean {
  return one !== "" && one.trim().toLocaleLowerCase() === other.trim().toLocaleLowerCase();
}

/**
 * Takes a seat in the room, or a place in the tournament, with this code; returns the route to it.
 */
async function comeIn(code: string, name: string, asRobot: boolean): Promise<Route> {
  try {
    const { roomId } = asRobot
      ? await takeSeat(code, name, undefined, ParticipantKind.ROBOT, NO_KEY)
      : await takeSeat(code, name);
    return { page: "room", roomId };
  } catch (thrown) {
    if (faultOf(thrown).reason !== "JOIN_CODE_WRONG") throw thrown;
    const found = await lookUp(code);
    if (found.kind !== "tournament") throw thrown;
    const { tournamentId } = found;
    // A second place would overwrite the first one's ticket on this device.
    if (!heldPlace(tournamentId)) await takePlace(tournamentId, code, name);
    return { page: "tournament", tournamentId };
  }
}

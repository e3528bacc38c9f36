// The invitation to a room, on the devices that know its join code: that of its creator, and those
// with a seat that was taken with it.

import { t } from "../i18n";
import { Invite } from "./Invite";
import css from "./Invite.module.css";
import { codeOf, hostedRoom, invitation } from "./seat";

/** The invitation; null on other devices. The command for agents is for the creator of the room. */
export function RoomInvite({ roomId, forAgents }: { roomId: string; forAgents: boolean }) {
  const hosted = hostedRoom(roomId);
  const code = hosted?.joinCode ?? codeOf(roomId);
  if (code === undefined) return null;
  const words = t().lobby.invite;
  const command = `chefshat agent greedy --server ${location.origin} --code ${code}`;
  return (
    <section class={`sheet ${css.roomInvite}`}>
      <Invite
        title={words.title}
        code={code}
        address={invitation(code)}
        agent={hosted && forAgents ? { label: words.agent, command } : undefined}
      />
    </section>
  );
}

// The invitation to a room on the device that created it.

import { t } from "../i18n";
import { Invite } from "./Invite";
import css from "./Invite.module.css";
import { hostedRoom, invitation } from "./seat";

/** The invitation, for the creator of the room; null for everyone else. */
export function HostInvite({ roomId, forAgents }: { roomId: string; forAgents: boolean }) {
  const hosted = hostedRoom(roomId);
  if (!hosted) return null;
  const { joinCode: code } = hosted;
  const words = t().lobby.invite;
  const command = `chefshat agent greedy --server ${location.origin} --code ${code}`;
  return (
    <section class={`sheet ${css.hostInvite}`}>
      <Invite
        title={words.title}
        code={code}
        address={invitation(code)}
        agent={forAgents ? { label: words.agent, command } : undefined}
      />
    </section>
  );
}

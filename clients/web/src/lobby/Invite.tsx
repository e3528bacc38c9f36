// How others come into a room: the join code to read out, the address to send, and the same as a picture to point a phone at.

import { useMemo, useState } from "preact/hooks";
import { encode } from "uqr";
import { StudyLinks } from "../experiment/StudyLinks";
import { t } from "../i18n";
import { announce } from "../parts/Announcer";
import { Button } from "../parts/Button";
import { hostedRoom, invitation } from "./seat";
import "./invite.css";

/** White around the picture, in its squares: readers need four. */
const QR_MARGIN = 4;

/** The invitation to the room with this join code. */
export function Invite({ code }: { code: string }) {
  const words = t().lobby.invite;
  const address = invitation(code);
  return (
    <section class="invite">
      <div class="invite-words">
        <h2>{words.title}</h2>
        <p>{words.text}</p>
        <CopyLine label={words.code} text={code} large />
        <CopyLine label={words.link} text={address} />
        <CopyLine label={words.agent} text={agentCommand(code)} mono />
      </div>
      <QrCode text={address} label={words.qr} />
    </section>
  );
}

/** The invitation, for whoever made the room; nothing for all others. */
export function HostInvite({ roomId }: { roomId: string }) {
  const hosted = hostedRoom(roomId);
  return (
    hosted && (
      <section class="sheet host-invite">
        <Invite code={hosted.joinCode} />
        <StudyLinks roomId={roomId} code={hosted.joinCode} />
      </section>
    )
  );
}

/** What seats an agent from a terminal. */
function agentCommand(code: string): string {
  return `chefshat agent greedy --server ${location.origin} --code ${code}`;
}

/** Something to copy, with its label. */
export function CopyLine(props: { label: string; text: string; large?: boolean; mono?: boolean }) {
  const { label, text, large = false, mono = false } = props;
  const words = t().common;
  const [copied, setCopied] = useState(false);
  const copy = async () => {
    // Without a secure origin a browser has no clipboard; the text can be marked by hand.
    await navigator.clipboard?.writeText(text).then(
      () => {
        setCopied(true);
        announce(words.copied);
      },
      () => undefined,
    );
  };
  return (
    <div class="invite-line">
      <span class="soft small">{label}</span>
      {mono ? (
        <code class="invite-link">{text}</code>
      ) : (
        <span class={large ? "invite-code" : "invite-link"}>{text}</span>
      )}
      {navigator.clipboard && (
        <Button onClick={copy}>
          {copied ? `✓ ${words.copied}` : words.copy}
          <span class="only-heard"> {label}</span>
        </Button>
      )}
    </div>
  );
}

/** A text as a QR code: black on white by dark as well, as readers want it. */
export function QrCode({ text, label }: { text: string; label: string }) {
  const { path, size } = useMemo(() => qrPath(text), [text]);
  return (
    <svg class="qr" viewBox={`0 0 ${size} ${size}`} role="img" aria-label={label} shape-rendering="crispEdges">
      <rect width={size} height={size} fill="#ffffff" />
      <path d={path} fill="#000000" />
    </svg>
  );
}

/** The dark squares of a QR code as one path, and the length of its side in squares. */
export function qrPath(text: string): { path: string; size: number } {
  const { data, size } = encode(text, { ecc: "M", border: QR_MARGIN });
  const path = data.flatMap((row, y) => row.flatMap((dark, x) => (dark ? [`M${x} ${y}h1v1h-1z`] : []))).join("");
  return { path, size };
}

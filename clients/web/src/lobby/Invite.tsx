// How others come into a room or a tournament: the join code to read out, the address to send, and the same as a picture to point a phone at.

import { useMemo, useState } from "preact/hooks";
import { encode } from "uqr";
import { StudyLinks } from "../experiment/StudyLinks";
import { t } from "../i18n";
import { announce } from "../parts/Announcer";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import css from "./Invite.module.css";
import { hostedRoom, invitation } from "./seat";

/** White around the picture, in its squares: readers need four. */
const QR_MARGIN = 4;

interface InviteProps {
  title: string;
  code: string;
  /** What is sent, and what the picture says. */
  address: string;
  /** What brings an agent from a terminal, and what this is for; undefined where there is no place for one. */
  agent: { label: string; command: string } | undefined;
}

/** An invitation to a room or a tournament. */
export function Invite({ title, code, address, agent }: InviteProps) {
  const words = t().lobby.invite;
  return (
    <section class={css.invite}>
      <div class={css.words}>
        <h2>{title}</h2>
        <p>{words.text}</p>
        <CopyLine label={words.code} text={code} large />
        <CopyLine label={words.link} text={address} />
        {agent && <CopyLine label={agent.label} text={agent.command} mono />}
      </div>
      <QrCode text={address} label={words.qr} />
      {isThisMachine(location.hostname) && (
        <div class={css.here}>
          <Notice kind="hint">
            <span>
              {words.thisMachine} <code>chefshat serve --listen 0.0.0.0:{location.port || "80"}</code>
              {words.thenOpen}
            </span>
          </Notice>
        </div>
      )}
    </section>
  );
}

/** Whether an address with this host leads to nothing but the machine on which it is opened. */
export function isThisMachine(host: string): boolean {
  return host === "localhost" || host.endsWith(".localhost") || host === "[::1]" || /^127(\.\d+){3}$/.test(host);
}

/** The invitation, for whoever made the room; nothing for all others. */
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
      <StudyLinks roomId={roomId} address={invitation(code)} />
    </section>
  );
}

/** Something to copy, with its label. */
export function CopyLine(props: { label: string; text: string; large?: boolean; mono?: boolean }) {
  const { label, text, large = false, mono = false } = props;
  const words = t().common;
  const { copied, copy } = useCopying(text);
  return (
    <div class={css.line}>
      <span class="soft small">{label}</span>
      {mono ? (
        <code class={css.link}>{text}</code>
      ) : (
        <span class={large ? css.code : css.link} data-part={large ? "invite-code" : "invite-link"}>
          {text}
        </span>
      )}
      {copy && (
        <Button onClick={copy}>
          {copied ? `✓ ${words.copied}` : words.copy}
          <span class="visually-hidden"> {label}</span>
        </Button>
      )}
    </div>
  );
}

/** How a text is copied, and whether it has been; without a secure origin a browser has no clipboard, but the text can be marked by hand. */
export function useCopying(text: string): { copied: boolean; copy: (() => void) | undefined } {
  const [copied, setCopied] = useState("");
  const clipboard: Clipboard | undefined = navigator.clipboard;
  const copy = () =>
    void clipboard?.writeText(text).then(
      () => {
        setCopied(text);
        announce(t().common.copied);
      },
      () => undefined,
    );
  return { copied: text !== "" && copied === text, copy: clipboard && copy };
}

/** A text as a QR code: black on white by dark as well, as readers want it. */
export function QrCode({ text, label }: { text: string; label: string }) {
  const { path, size } = useMemo(() => qrPath(text), [text]);
  return (
    <svg class={css.qr} viewBox={`0 0 ${size} ${size}`} role="img" aria-label={label} shape-rendering="crispEdges">
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

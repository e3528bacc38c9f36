// Invitations to a room or tournament: the join code, the address, and its QR code.

import { useMemo, useState } from "preact/hooks";
import { encode } from "uqr";
import { t } from "../i18n";
import { announce } from "../parts/Announcer";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import css from "./Invite.module.css";

/** Quiet zone around the QR code, in modules: scanners need four. */
const QR_MARGIN = 4;

interface InviteProps {
  title: string;
  code: string;
  /** The address to send, also in the QR code. */
  address: string;
  /** The command that connects an agent, and its label; undefined if no agent can join. */
  agent: { label: string; command: string } | undefined;
}

/** An invitation to a room or a tournament. */
export function Invite({ title, code, address, agent }: InviteProps) {
  const words = t().lobby.invite;
  return (
    <section class={css.invite}>
      <div class="stack">
        <h2>{title}</h2>
        <p>{words.text}</p>
        <CopyLine label={t().lobby.join.code} text={code} large />
        <CopyLine label={words.link} text={address} />
        {agent && <CopyLine label={agent.label} text={agent.command} mono />}
      </div>
      <QrCode text={address} label={words.qr} />
      <ThisMachine />
    </section>
  );
}

/** Says that the addresses of this page lead nowhere on other devices; nothing if they do. */
export function ThisMachine() {
  const words = t().lobby.invite;
  if (!isThisMachine(location.hostname)) return null;
  return (
    <div class={css.here}>
      <Notice kind="hint">
        <span>
          {words.thisMachine} <code>chefshat serve --listen 0.0.0.0:{location.port || "80"} --access open</code>
          {words.thenOpen}
        </span>
      </Notice>
    </div>
  );
}

/** Whether this host name leads only to the machine that opens it. */
export function isThisMachine(host: string): boolean {
  return host === "localhost" || host.endsWith(".localhost") || host === "[::1]" || /^127(\.\d+){3}$/.test(host);
}

/** A text to copy, with its label. */
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

/**
 * Copies a text. Without a secure origin a browser has no clipboard, but the text can be selected
 * by hand.
 */
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

/** A text as a QR code: black on white, as scanners need it; in the dark theme on a grey that does not dazzle. */
export function QrCode({ text, label }: { text: string; label: string }) {
  const { path, size } = useMemo(() => qrPath(text), [text]);
  return (
    <svg class={css.qr} viewBox={`0 0 ${size} ${size}`} role="img" aria-label={label} shape-rendering="crispEdges">
      <rect width={size} height={size} fill="light-dark(#ffffff, #d2ccc2)" />
      <path d={path} fill="#000000" />
    </svg>
  );
}

/** The dark modules of a QR code as one path, and the length of its side in modules. */
export function qrPath(text: string): { path: string; size: number } {
  const { data, size } = encode(text, { ecc: "M", border: QR_MARGIN });
  const path = data.flatMap((row, y) => row.flatMap((dark, x) => (dark ? [`M${x} ${y}h1v1h-1z`] : []))).join("");
  return { path, size };
}

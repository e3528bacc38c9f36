// Moves a seat or place to another device: a link to open there, and its QR code.

import { useState } from "preact/hooks";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { Dialog } from "../parts/Dialog";
import { Tool } from "../table/view/Tools";
import { CopyLine, QrCode, ThisMachine } from "./Invite";
import leavingCss from "./Leaving.module.css";
import css from "./MoveToDevice.module.css";

interface MoveButtonProps {
  /** An icon among the tools of the table, or a button with text. */
  look: "tool" | "button";
  onClick: () => void;
}

/** Opens the dialog. */
export function MoveButton({ look, onClick }: MoveButtonProps) {
  const words = t().lobby.moving;
  return look === "tool" ? (
    <Tool label={words.title} data-part="tool tool-move" onClick={onClick}>
      <path d="M9 3h9v18H9ZM12 18h3M3 12h8M8 8.500l3.500 3.500l-3.500 3.500" />
    </Tool>
  ) : (
    <p class={leavingCss.leaving}>
      <Button look="quiet" onClick={onClick}>
        {words.title}
      </Button>
    </p>
  );
}

/** The link, which has a secret, and its QR code. */
export function MoveDialog({ address, onClose }: { address: string; onClose: () => void }) {
  const words = t().lobby.moving;
  return (
    <Dialog title={words.title} onClose={onClose}>
      <p>{words.text}</p>
      <div class={css.code}>
        <QrCode text={address} label={words.qr} />
      </div>
      <CopyLine label={words.link} text={address} />
      <ThisMachine />
    </Dialog>
  );
}

/** The button with its dialog. */
export function MoveToDevice({ address }: { address: string }) {
  const [open, setOpen] = useState(false);
  return (
    <>
      <Button look="quiet" onClick={() => setOpen(true)}>
        {t().lobby.moving.title}
      </Button>
      {open && <MoveDialog address={address} onClose={() => setOpen(false)} />}
    </>
  );
}

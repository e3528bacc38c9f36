// Moves a seat or place to another device: a link to open there, and its QR code.

import { useState } from "preact/hooks";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { Dialog } from "../parts/Dialog";
import { Tool } from "../table/view/Tools";
import { CopyLine, QrCode, ThisMachine } from "./Invite";
import css from "./MoveToDevice.module.css";

interface MoveToDeviceProps {
  /** The link, with a secret. */
  address: string;
  /** An icon among the tools of the table, or a button with text. */
  look: "tool" | "button";
}

/** Opens the dialog. */
export function MoveToDevice({ address, look }: MoveToDeviceProps) {
  const [open, setOpen] = useState(false);
  const words = t().lobby.moving;
  return (
    <>
      {look === "tool" ? (
        <Tool label={words.title} data-part="tool tool-move" onClick={() => setOpen(true)}>
          <path d="M9 3h9v18H9ZM12 18h3M3 12h8M8 8.500l3.500 3.500l-3.500 3.500" />
        </Tool>
      ) : (
        <Button look="quiet" onClick={() => setOpen(true)}>
          {words.title}
        </Button>
      )}
      {open && (
        <Dialog title={words.title} onClose={() => setOpen(false)}>
          <p>{words.text}</p>
          <div class={css.code}>
            <QrCode text={address} label={words.qr} />
          </div>
          <CopyLine label={words.link} text={address} />
          <ThisMachine />
        </Dialog>
      )}
    </>
  );
}

// What somebody sees who opens a study on a device that it does not run on: which one it needs, and the
// link to open there. Nothing has begun.

import { useEffect } from "preact/hooks";
import type { Fault } from "../api/faults";
import { StudyPointer } from "../gen/chefshat/v1/study_pb";
import { showLanguage, t } from "../i18n";
import { CopyLine, QrCode } from "../lobby/Invite";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { thisDevice } from "./device";
import css from "./Study.module.css";

/** Why a study is not opened here. */
export const WRONG_DEVICE = "WRONG_DEVICE";

const POINTERS: Readonly<Record<string, StudyPointer>> = { fine: StudyPointer.FINE, coarse: StudyPointer.COARSE };

/** The page, for the refusal of the server. `retry` opens the study again. */
export function WrongDevice({ fault: { metadata }, retry }: { fault: Fault; retry: () => void }) {
  const words = t().studies.device;
  const { pointer: needed = "", language = "" } = metadata;
  const width = Number(metadata.min_width ?? 0);
  const { pointer, width: own } = thisDevice();
  const hasPointer = POINTERS[needed] === undefined || POINTERS[needed] === pointer;
  useEffect(() => {
    void showLanguage(language);
  }, [language]);
  // A window that was made wide enough needs no button.
  useEffect(() => {
    if (!hasPointer) return;
    const open = () => {
      if (Number(thisDevice().width) >= width) retry();
    };
    window.addEventListener("resize", open);
    return () => window.removeEventListener("resize", open);
  }, [hasPointer, width]);
  return (
    <section class={`sheet ${css.stage}`} data-part="study-device">
      <h1>{words.title}</h1>
      <Notice kind="hint">
        {needed === "fine" && <p>{words.computer}</p>}
        {needed === "coarse" && <p>{words.touch}</p>}
        {width > 0 && <p>{words.width(width, Number(own))}</p>}
      </Notice>
      <p>{hasPointer ? words.wider : words.there}</p>
      <CopyLine label={t().lobby.moving.link} text={location.href} />
      {needed !== "fine" && (
        <div class={css.code}>
          <QrCode text={location.href} label={t().lobby.moving.qr} />
        </div>
      )}
      <div>
        <Button look="main" onClick={retry}>
          {words.retry}
        </Button>
      </div>
    </section>
  );
}

// The pictures of a study in its form: chosen from files, with what a text has to say to show them.

import { useState } from "preact/hooks";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { Field } from "../parts/Field";
import css from "./Own.module.css";
import { PICTURES, type PictureFile, pictureOf, withPicture } from "./picture-files";

interface Props {
  pictures: readonly PictureFile[];
  fault: string | undefined;
  /** Changes the pictures as they are then: files take time to read. */
  onChange: (change: (pictures: readonly PictureFile[]) => readonly PictureFile[]) => void;
}

/** The fields. */
export function PictureFields({ pictures, fault, onChange }: Props) {
  const words = t().studies.make;
  const [unreadable, setUnreadable] = useState("");
  const add = async (files: readonly File[]) => {
    setUnreadable("");
    for (const file of files) {
      try {
        const added = await pictureOf(file);
        onChange((now) => withPicture(now, added));
      } catch (thrown) {
        setUnreadable(words.unreadable(`${file.name}: ${thrown instanceof Error ? thrown.message : thrown}`));
      }
    }
  };
  return (
    <div class={css.part} data-part="pictures">
      <Field label={words.pictures} hint={words.picturesHint} fault={unreadable || fault}>
        {(joined) => (
          <input
            {...joined}
            type="file"
            multiple
            accept={PICTURES}
            onChange={(event) => {
              void add([...(event.currentTarget.files ?? [])]);
              // So that the same file can be chosen again.
              event.currentTarget.value = "";
            }}
          />
        )}
      </Field>
      <div role="status">
        {pictures.length > 0 && (
          <ul class={css.pictures}>
            {pictures.map(({ name }) => (
              <li key={name}>
                <code>{`![${words.pictureWords}](${name})`}</code>
                <Button look="quiet" onClick={() => onChange((now) => now.filter((picture) => picture.name !== name))}>
                  {words.removePicture}
                  <span class="visually-hidden"> {name}</span>
                </Button>
              </li>
            ))}
          </ul>
        )}
      </div>
    </div>
  );
}

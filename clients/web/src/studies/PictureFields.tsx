// The pictures of a study in its form: chosen from files, with what a text has to say to show them.

import { t } from "../i18n";
import { Button } from "../parts/Button";
import { Field } from "../parts/Field";
import css from "./Own.module.css";
import { PICTURES, type PictureFile, pictureOf } from "./picture-files";

interface Props {
  pictures: readonly PictureFile[];
  fault: string | undefined;
  onChange: (pictures: readonly PictureFile[]) => void;
}

/** The fields. A file of the same name as another one takes its place. */
export function PictureFields({ pictures, fault, onChange }: Props) {
  const words = t().studies.make;
  const add = async (files: readonly File[]) => {
    const added = await Promise.all(files.map(pictureOf));
    onChange([...new Map([...pictures, ...added].map((picture) => [picture.name, picture])).values()]);
  };
  return (
    <div class={css.part} data-part="pictures">
      <Field label={words.pictures} hint={words.picturesHint} fault={fault}>
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
      {pictures.length > 0 && (
        <ul class={css.pictures}>
          {pictures.map(({ name }) => (
            <li key={name}>
              <code>{`![${words.pictureWords}](${name})`}</code>
              <Button look="quiet" onClick={() => onChange(pictures.filter((picture) => picture.name !== name))}>
                {words.removePicture}
                <span class="visually-hidden"> {name}</span>
              </Button>
            </li>
          ))}
        </ul>
      )}
    </div>
  );
}

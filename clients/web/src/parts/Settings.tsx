// Language and look, chosen on this device. What belongs to one page alone (sounds, speed of a replay) is set on that page.

import { type Language, language, languages, setLanguage, t } from "../i18n";
import { type Look, look, setLook } from "../look";
import { Dialog } from "./Dialog";
import { SelectField } from "./Field";

/** The dialog of settings. */
export function Settings({ onClose }: { onClose: () => void }) {
  const words = t().common.settings;
  const looks: Look[] = ["system", "light", "dark"];
  return (
    <Dialog title={words.title} onClose={onClose}>
      <div class="settings">
        <SelectField
          label={words.language}
          value={language.value}
          options={Object.entries(languages).map(([value, label]) => ({ value: value as Language, label }))}
          onPick={(picked) => void setLanguage(picked)}
        />
        <SelectField
          label={words.look}
          value={look.value}
          options={looks.map((value) => ({ value, label: words.looks[value] }))}
          onPick={setLook}
        />
      </div>
    </Dialog>
  );
}

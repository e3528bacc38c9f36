// The settings of this device: language, theme, and deleting what is stored. Settings of a single
// page (sound, replay speed) are on that page.

import { useState } from "preact/hooks";
import { type Language, language, languages, setLanguage, t } from "../i18n";

import { forgetAll } from "../store";
import { setTheme, type Theme, theme } from "../theme";
import { Button } from "./Button";
import { Dialog } from "./Dialog";
import { SelectField } from "./Field";
import css from "./Layout.module.css";

/** The dialog of settings. */
export function Settings({ onClose }: { onClose: () => void }) {
  const words = t().common.settings;
  const themes: Theme[] = ["system", "light", "dark"];
  return (
    <Dialog title={words.title} onClose={onClose}>
      <div class={css.settings}>
        <SelectField
          label={words.language}
          value={language.value}
          options={Object.entries(languages).map(([value, label]) => ({ value: value as Language, label }))}
          onPick={(picked) => void setLanguage(picked)}
        />
        <SelectField
          label={words.theme}
          value={theme.value}
          options={themes.map((value) => ({ value, label: words.themes[value] }))}
          onPick={setTheme}
        />
        <Forget />
      </div>
    </Dialog>
  );
}

/** Deletes everything that is stored, after a confirmation: seats are lost with it. */
function Forget() {
  const words = t().common.settings;
  const [sure, setSure] = useState(false);
  const forget = () => {
    forgetAll();
    // A page that stays open would store again what it still has in memory.
    location.assign("/");
  };
  if (!sure) {
    return <Button onClick={() => setSure(true)}>{words.forget}</Button>;
  }
  return (
    <div>
      <p>{words.forgetSure}</p>
      <Button onClick={forget}>{words.forgetDo}</Button>{" "}
      <Button look="quiet" onClick={() => setSure(false)}>
        {t().common.cancel}
      </Button>
    </div>
  );
}

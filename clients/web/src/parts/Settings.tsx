// The settings of this device: language, theme, and deleting what is stored. Settings of a single
// page (sound, replay speed) are on that page.

import { type Language, language, languages, setLanguage, t } from "../i18n";

import { forgetAll } from "../store";
import { setTheme, type Theme, theme } from "../theme";
import { ConfirmButton } from "./ConfirmButton";
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
  const forget = async () => {
    forgetAll();
    // A page that stays open would store again what it still has in memory.
    location.assign("/");
  };
  return (
    <ConfirmButton label={words.forget} confirm={words.forgetDo} look="plain" act={forget}>
      {words.forgetSure}
    </ConfirmButton>
  );
}

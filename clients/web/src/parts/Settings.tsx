// Language and look, chosen on this device, and forgetting what it remembers. What belongs to one page alone (sounds, speed of a replay) is set on that page.

import { useState } from "preact/hooks";
import { type Language, language, languages, setLanguage, t } from "../i18n";
import { type Look, look, setLook } from "../look";
import { forgetAll } from "../store";
import { Button } from "./Button";
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
        <Forget />
      </div>
    </Dialog>
  );
}

/** Forgets everything, after asking once more: seats are lost with it. */
function Forget() {
  const words = t().common.settings;
  const [sure, setSure] = useState(false);
  const forget = () => {
    forgetAll();
    // A page that goes on would write down again what it still knows.
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

// The settings of this device: language, theme, what happens at the table, the connection, full
// screen, and deleting what is stored. Sound and replay speed are on their pages.

import { useState } from "preact/hooks";
import { serverApi } from "../api/client";
import { wordsOf } from "../api/faults";
import { usePolled } from "../api/poll";
import { type Language, language, languages, setLanguage, t } from "../i18n";
import { isNameKey, nameKeyText, setNameKey } from "../name-key";
import { isOn, type Preference, setPreference } from "../preferences";
import { forgetAll } from "../store";
import { askToNotify, canNotify } from "../table/attention";
import { setTheme, type Theme, theme } from "../theme";
import { Button } from "./Button";
import { ConfirmButton } from "./ConfirmButton";
import { Dialog } from "./Dialog";
import { CheckField, SelectField, TextField } from "./Field";
import css from "./Layout.module.css";
import { Notice } from "./Notice";
import { UpdateSetting } from "./Update";

/** The dialog of settings. */
export function Settings({ onClose }: { onClose: () => void }) {
  const words = t().common.settings;
  const themes: Theme[] = ["system", "light", "dark"];
  const [failed, setFailed] = useState(false);
  const pickLanguage = (picked: Language) => {
    setFailed(false);
    setLanguage(picked).catch(() => setFailed(true));
  };
  return (
    <Dialog title={words.title} onClose={onClose}>
      <div class={css.settings}>
        <UpdateSetting />
        <SelectField label={words.language} value={language.value} options={languages} onPick={pickLanguage} />
        {failed && <Notice kind="fault">{t().common.pageNotLoaded}</Notice>}
        <SelectField
          label={words.theme}
          value={theme.value}
          options={themes.map((value) => ({ value, label: words.themes[value] }))}
          onPick={setTheme}
        />
        <AtTheTable />
        <OwnNames />
        <Lag />
        <FullScreen onClose={onClose} />
        <Forget />
      </div>
    </Dialog>
  );
}

/** The switches of the table. What this browser cannot do is left out. */
function AtTheTable() {
  const words = t().common.settings.table;
  const possible: Preference[] = [
    "tab",
    ...("vibrate" in navigator ? (["vibration"] as const) : []),
    ...("wakeLock" in navigator ? (["awake"] as const) : []),
    "keys",
    "plans",
    "autoPass",
    "moments",
  ];
  return (
    <fieldset class={css.switches}>
      <legend>{words.title}</legend>
      {canNotify() && <Notifications />}
      {possible.map((name) => (
        <CheckField
          key={name}
          label={words.names[name]}
          hint={words.hints[name]}
          checked={isOn(name)}
          onCheck={(on) => setPreference(name, on)}
        />
      ))}
    </fieldset>
  );
}

/** Asks the browser when it is switched on, never before. */
function Notifications() {
  const words = t().common.settings.table;
  const [refused, setRefused] = useState(false);
  const change = async (on: boolean) => {
    const allowed = !on || (await askToNotify());
    setRefused(!allowed);
    setPreference("notification", on && allowed);
  };
  return (
    <CheckField
      label={words.names.notification}
      hint={words.hints.notification}
      fault={refused ? words.notAllowed : undefined}
      checked={isOn("notification") && Notification.permission === "granted"}
      onCheck={(on) => void change(on)}
    />
  );
}

/**
 * The key of this device's names, to copy to another device or from there. One that would replace
 * another is confirmed: with the former, a person would be lost.
 */
function OwnNames() {
  const words = t().common.settings.names;
  const [stored, setStored] = useState(nameKeyText());
  const [text, setText] = useState(stored ?? "");
  const store = (key: string) => {
    setNameKey(key);
    setStored(nameKeyText());
  };
  const change = (typed: string) => {
    const key = typed.trim();
    setText(key);
    if (isNameKey(key) && stored === null) store(key);
  };
  const isKey = isNameKey(text);
  return (
    <>
      <TextField
        label={words.key}
        hint={words.hint}
        fault={isKey || (text === "" && stored === null) ? undefined : words.notAKey}
        value={text}
        onText={change}
        autoCapitalize="none"
      />
      {isKey && stored !== null && text.toLowerCase() !== stored && (
        <ConfirmButton label={words.use} look="plain" act={async () => store(text)}>
          {words.replaces}
        </ConfirmButton>
      )}
    </>
  );
}

/** Time between two measurements of the connection, milliseconds. */
const MEASURE_EVERY_MS = 3_000;

/** How long the server takes to answer, measured while the settings are open. */
function Lag() {
  const words = t().common.settings;
  const measure = async (signal: AbortSignal) => {
    const begunMs = performance.now();
    await serverApi.getServerInfo({}, { signal });
    return Math.round(performance.now() - begunMs);
  };
  const { value: lagMs, fault } = usePolled(measure, MEASURE_EVERY_MS, "");
  return (
    <p class="soft" data-part="lag">
      {fault ? wordsOf(fault) : lagMs === null ? words.measuring : words.lag(lagMs)}
    </p>
  );
}

/** Shows the page without the browser's bars, where the browser can. */
function FullScreen({ onClose }: { onClose: () => void }) {
  const words = t().common.settings;
  if (!document.fullscreenEnabled) return null;
  const on = document.fullscreenElement !== null;
  const change = () => {
    // First: the page would cover the dialog.
    onClose();
    void (on ? document.exitFullscreen() : document.documentElement.requestFullscreen());
  };
  return <Button onClick={change}>{on ? words.fullScreenOff : words.fullScreen}</Button>;
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

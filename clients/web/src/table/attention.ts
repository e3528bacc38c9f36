// Calls a person back to the table on their turn, each way only if it is switched on and the browser
// has it: the title and icon of the tab, a notification while the page is not seen, vibration. The
// screen stays on during the game. Sounds and announcements are in following.ts.

import { useEffect } from "preact/hooks";
import { t } from "../i18n";
import { useTabMark } from "../parts/tab";
import { isOn } from "../preferences";
import type { OpenDecision } from "./model/live";

/** Length of the vibration, milliseconds. */
const VIBRATION_MS = 180;
/** Notifications with the same tag replace one another. */
const TAG = "chefshat-turn";

/** Calls for each open decision; `playing` while the game lasts. */
export function useAttention(decision: OpenDecision | undefined, playing: boolean): void {
  const words = t().table.now.yourTurn;
  const id = decision?.id;
  useTabMark(id !== undefined && isOn("tab") ? words : "");
  useEffect(() => {
    if (id === undefined) return;
    if (isOn("vibration") && navigator.userActivation?.hasBeenActive) navigator.vibrate?.(VIBRATION_MS);
    if (!isOn("notification") || !isUnseen()) return;
    void notify(words);
    window.addEventListener("focus", withdraw);
    return () => {
      window.removeEventListener("focus", withdraw);
      withdraw();
    };
  }, [id]);
  useAwake(playing && isOn("awake"));
}

/** Whether this browser can notify, if the reader allows it. */
export function canNotify(): boolean {
  return "Notification" in globalThis && globalThis.isSecureContext;
}

/** Asks the browser for notifications, on a click. Returns whether they are allowed. */
export async function askToNotify(): Promise<boolean> {
  return (await Notification.requestPermission()) === "granted";
}

function isUnseen(): boolean {
  return document.hidden || !document.hasFocus();
}

/** The open notification, where it is not the service worker's. */
let shown: Notification | undefined;

/** Says no more than that: the name of a room may be confidential. */
async function notify(words: string): Promise<void> {
  if (!canNotify() || Notification.permission !== "granted") return;
  const options = { tag: TAG, body: t().common.name, icon: "/icons/icon-192.png" };
  const worker = await navigator.serviceWorker?.getRegistration();
  // Phones show only those of a service worker.
  if (worker) return worker.showNotification(words, options);
  shown = new Notification(words, options);
  shown.onclick = () => {
    window.focus();
    withdraw();
  };
}

function withdraw(): void {
  shown?.close();
  shown = undefined;
  void navigator.serviceWorker
    ?.getRegistration()
    .then((worker) => worker?.getNotifications({ tag: TAG }))
    .then((open) => {
      for (const one of open ?? []) one.close();
    });
}

/** Keeps the screen on while `on`. The browser lets it go whenever the page is hidden. */
function useAwake(on: boolean): void {
  useEffect(() => {
    if (!on || !("wakeLock" in navigator)) return;
    let lock: WakeLockSentinel | undefined;
    let ended = false;
    const take = async () => {
      if (document.hidden) return;
      try {
        lock = await navigator.wakeLock.request("screen");
        if (ended) await lock.release();
      } catch {
        // Not granted: the battery is low, or the page was hidden meanwhile.
      }
    };
    const again = () => void take();
    document.addEventListener("visibilitychange", again);
    again();
    return () => {
      ended = true;
      document.removeEventListener("visibilitychange", again);
      void lock?.release();
    };
  }, [on]);
}

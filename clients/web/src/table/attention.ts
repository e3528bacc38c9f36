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

/** Calls for each open decision in a room; `playing` while the game lasts. */
export function useAttention(roomId: string, decision: OpenDecision | undefined, playing: boolean): void {
  const words = t().table.now.yourTurn;
  const id = decision?.id;
  useTabMark(id !== undefined && isOn("tab") ? words : "");
  useEffect(() => {
    if (id === undefined) return;
    if (isOn("vibration") && navigator.userActivation?.hasBeenActive) navigator.vibrate?.(VIBRATION_MS);
    if (!isOn("notification") || !isUnseen()) return;
    const withdraw = notify(words, `turn ${roomId}`);
    window.addEventListener("focus", withdraw);
    return () => {
      window.removeEventListener("focus", withdraw);
      withdraw();
    };
  }, [roomId, id]);
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

/**
 * Shows a notification until the returned function is called; those with the same tag replace one
 * another. It has no name: that of a room may be confidential.
 */
function notify(words: string, tag: string): () => void {
  if (!canNotify() || Notification.permission !== "granted") return () => {};
  let ended = false;
  const close = show(words, tag, () => ended).catch(() => {
    // Phones refuse notifications of a page without a service worker.
  });
  return () => {
    ended = true;
    void close.then((close) => close?.());
  };
}

/** Shows a notification, unless it is not wanted any more. Returns what closes it. */
async function show(words: string, tag: string, isOver: () => boolean): Promise<(() => void) | undefined> {
  // The path is for sw.js.
  const options = { tag, body: t().common.name, icon: "/icons/icon-192.png", data: { path: location.pathname } };
  const worker = await navigator.serviceWorker?.getRegistration();
  if (isOver()) return undefined;
  if (worker) {
    await worker.showNotification(words, options);
    return async () => {
      for (const open of await worker.getNotifications({ tag })) open.close();
    };
  }
  const shown = new Notification(words, options);
  shown.onclick = () => {
    window.focus();
    shown.close();
  };
  return () => shown.close();
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

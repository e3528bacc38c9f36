// The service worker of the page. It exists for notifications on phones and for installing the page;
// it has no fetch handler, so that nothing of the page or of a game is ever cached by it.

self.addEventListener("install", () => self.skipWaiting());
self.addEventListener("activate", (event) => event.waitUntil(self.clients.claim()));

// A click on the notification of a turn returns to the page.
self.addEventListener("notificationclick", (event) => {
  event.notification.close();
  event.waitUntil(returnToPage());
});

async function returnToPage() {
  const pages = await self.clients.matchAll({ type: "window", includeUncontrolled: true });
  const table = pages.find(({ url }) => /\/(rooms|tournaments)\//.test(new URL(url).pathname)) ?? pages[0];
  return table ? table.focus() : self.clients.openWindow("/");
}

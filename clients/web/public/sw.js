// The service worker of the page. It exists for notifications on phones and for installing the page;
// it has no fetch handler, so that nothing of the page or of a game is ever cached by it.

self.addEventListener("install", () => self.skipWaiting());
self.addEventListener("activate", (event) => event.waitUntil(self.clients.claim()));

// A click on the notification of a turn returns to the page that called.
self.addEventListener("notificationclick", (event) => {
  event.notification.close();
  event.waitUntil(returnTo(event.notification.data.path));
});

async function returnTo(path) {
  const pages = await self.clients.matchAll({ type: "window", includeUncontrolled: true });
  const page = pages.find(({ url }) => new URL(url).pathname === path);
  return page ? page.focus() : self.clients.openWindow(path);
}

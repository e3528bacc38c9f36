// Builds the page (into dist/, which the server serves), serves it during development, and
// configures the tests without a browser.

import { readdirSync, readFileSync, realpathSync, rmSync, writeFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { constants, gzipSync } from "node:zlib";
import type { Plugin } from "vite";
import { defineConfig } from "vitest/config";

const repository = fileURLToPath(new URL("../..", import.meta.url));
/** The server that `npm run dev` forwards calls to. */
const server = process.env.CHEFSHAT_ADDRESS ?? "http://127.0.0.1:50051";

/**
 * Files that are compressed already, and the size in bytes below which compression gains nothing.
 */
const PACKED = /\.(woff2|gz|png)$/;
const SMALLEST_PACKED_BYTES = 512;

/**
 * Removes old assets from dist/ (but not its .gitignore) and writes a compressed copy beside each
 * file that is worth it.
 */
function packed(): Plugin {
  let dist = "";
  return {
    name: "chefshat-packed",
    apply: "build",
    configResolved(config) {
      dist = resolve(config.root, config.build.outDir);
    },
    generateBundle() {
      for (const old of ["assets", "index.html", "index.html.gz"])
        rmSync(join(dist, old), { recursive: true, force: true });
    },
    closeBundle() {
      for (const name of readdirSync(dist, { recursive: true, encoding: "utf8" })) {
        const path = join(dist, name);
        if (PACKED.test(name) || !/\.\w+$/.test(name) || name.startsWith(".")) continue;
        const bytes = readFileSync(path);
        if (bytes.length < SMALLEST_PACKED_BYTES) continue;
        writeFileSync(`${path}.gz`, gzipSync(bytes, { level: constants.Z_BEST_COMPRESSION }));
      }
    },
  };
}

export default defineConfig({
  plugins: [packed()],
  oxc: { jsx: { runtime: "automatic", importSource: "preact" } },
  css: { modules: { localsConvention: "camelCaseOnly" } },
  build: {
    target: "es2023",
    // The first versions with light-dark(), which theme.css uses: a translation for older ones
    // would not follow color-scheme.
    cssTarget: ["chrome123", "firefox120", "safari17.5"],
    emptyOutDir: false,
    // Drawings are inline; a font must stay a file that the browser can cache.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    // A browser without HTTP/2 makes six requests at a time: the common code comes in a few chunks,
    // by how often it changes. Libraries of single pages come with these.
    rolldownOptions: {
      output: {
        codeSplitting: {
          groups: [
            { name: "libraries", test: /node_modules[\\/](@bufbuild|@connectrpc|@fontsource-variable|@?preact)[\\/]/ },
            { name: "protocol", test: /src[\\/]gen[\\/]/ },
            { name: "parts", test: /src[\\/](parts|api|lobby)[\\/]|symbols[\\/]/ },
          ],
        },
      },
    },
  },
  server: {
    // The drawings of cards are outside this folder, with the server's pictures. The folder may be a
    // link.
    fs: { allow: [repository, realpathSync(join(repository, "server"))] },
    proxy: { "^/chefshat\\.v1\\.": { target: server } },
  },
  test: {
    environment: "happy-dom",
    // The DOM is set up once for all files, which would take most of their time.
    isolate: false,
    setupFiles: ["tests/setup.ts"],
    testTimeout: 60_000,
    include: ["tests/*.test.{ts,tsx}", "src/**/*.test.{ts,tsx}"],
  },
});

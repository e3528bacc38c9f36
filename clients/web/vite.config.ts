// How the page is built (into dist/, which the server embeds), served while it is worked on, and tested.

import { readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { constants, gzipSync } from "node:zlib";
import type { Plugin } from "vite";
import { defineConfig } from "vitest/config";

const repository = fileURLToPath(new URL("../..", import.meta.url));
/** Where `npm run dev` finds a server to talk to. */
const server = process.env.CHEFSHAT_ADDRESS ?? "http://127.0.0.1:50051";

/** Files that are compressed already, and so small ones that compressing gains nothing. */
const PACKED = /\.(woff2|gz|png)$/;
const SMALLEST_PACKED_BYTES = 512;

/** Takes old assets out of dist/ (which keeps its .gitignore) and puts a compressed twin beside each file that gains by it. */
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
  build: {
    target: "es2023",
    // The first ones that know light-dark(), which theme.css is written with: translated for older ones it would not follow color-scheme.
    cssTarget: ["chrome123", "firefox120", "safari17.5"],
    emptyOutDir: false,
    // Symbols are drawn inline; a font or sound must stay a file that a browser can keep.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    // A browser without HTTP/2 has six requests at a time: what every page needs comes in a few pieces, by how often it changes.
    rolldownOptions: {
      output: {
        codeSplitting: {
          groups: [
            { name: "libraries", test: /node_modules[\\/](?!uqr)/ },
            { name: "protocol", test: /src[\\/]gen[\\/]/ },
            { name: "parts", test: /src[\\/](parts|api|lobby)[\\/]|symbols[\\/]/ },
          ],
        },
      },
    },
  },
  // The drawings of cards lie with the server's pictures, outside of this folder.
  server: { fs: { allow: [repository] }, proxy: { "^/chefshat\\.v1\\.": { target: server } } },
  test: {
    environment: "happy-dom",
    include: ["tests/*.test.{ts,tsx}", "src/**/*.test.{ts,tsx}"],
  },
});

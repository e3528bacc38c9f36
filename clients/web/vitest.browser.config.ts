// How the tests in tests/browser are run: each file starts a server (CHEFSHAT_BIN) with the built page and a browser, one file after the
// other, so that they do not take the processor from each other.

import { defineConfig } from "vitest/config";

export default defineConfig({
  test: {
    environment: "node",
    include: ["tests/browser/**/*.test.ts"],
    fileParallelism: false,
    testTimeout: 120_000,
    hookTimeout: 60_000,
    expect: { poll: { timeout: 30_000 } },
  },
});

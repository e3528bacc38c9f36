// Runs the tests in tests/browser. Each file starts a server (CHEFSHAT_BIN) that serves the built
// page, and a browser. Two files run at a time: more would only compete for the processor.

import { defineConfig } from "vitest/config";
import { PATIENCE_MS } from "./tests/browser/patience";

export default defineConfig({
  test: {
    environment: "node",
    include: ["tests/browser/**/*.test.ts"],
    maxWorkers: 2,
    testTimeout: 5 * PATIENCE_MS,
    hookTimeout: 5 * PATIENCE_MS,
    expect: { poll: { timeout: PATIENCE_MS } },
  },
});

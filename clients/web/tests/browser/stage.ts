// The setup of a browser test: a server with the built page, and a browser for several people.

import { type ChildProcess, execFileSync, spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { type Browser, type BrowserContext, type BrowserContextOptions, chromium, type Page } from "playwright-core";
import { afterAll, afterEach, beforeAll, beforeEach, vi } from "vitest";
import { PATIENCE_MS } from "./patience";

const CHROMIUM = process.env.CHEFSHAT_CHROMIUM ?? "/usr/bin/chromium-headless-shell";
const FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"];
FLAGS.push("--disable-background-networking", "--disable-component-update", "--disable-sync");
// Proxies of the tests have certificates of an authority that Chromium does not know. The option of
// a context would not apply to service workers.
FLAGS.push("--ignore-certificate-errors");

/** Whether the tests use a server that they did not start. */
const GIVEN = process.env.CHEFSHAT_URL !== undefined;
/** How many times slower than this machine the pages run: no test may depend on their speed. */
const SLOWDOWN = Number(process.env.CHEFSHAT_SLOWDOWN ?? 1);

/** A running server. */
export class Server {
  private constructor(
    private process: ChildProcess | undefined,
    readonly dataDir: string,
    readonly address: string,
    private scheme = "http",
    /** A token of a host, if the server requires tokens. */
    readonly token?: string,
  ) {}

  /**
   * Starts the server CHEFSHAT_BIN on a free port, with a data folder of its own. If CHEFSHAT_URL is set, the tests use the server
   * there instead, such as one behind a proxy, whose data folder is CHEFSHAT_DATA_DIR; it cannot be restarted.
   */
  static async start(): Promise<Server> {
    return Server.running() ?? Server.startIn(dataFolder());
  }

  /** As `start`, but every call requires a token (`tokenFor`). */
  static async startWithTokens(): Promise<Server> {
    const running = Server.running();
    const dataDir = running?.dataDir ?? dataFolder();
    const token = createToken(dataDir, "host");
    return running
      ? new Server(undefined, dataDir, running.address, running.scheme, token)
      : Server.startIn(dataDir, token);
  }

  private static running(): Server | undefined {
    const { CHEFSHAT_URL: url, CHEFSHAT_DATA_DIR: dataDir = "" } = process.env;
    if (!url) return undefined;
    const { host, protocol } = new URL(url);
    return new Server(undefined, dataDir, host, protocol.replace(":", ""));
  }

  private static async startIn(dataDir: string, token?: string): Promise<Server> {
    const { child, address } = await serve(dataDir, "127.0.0.1:0");
    return new Server(child, dataDir, address, "http", token);
  }

  /** A new token with a role. */
  tokenFor(role: string): string {
    return createToken(this.dataDir, role);
  }

  /** Address of the page. */
  get url(): string {
    return `${this.scheme}://${this.address}`;
  }

  /** Kills the server and starts it again on the same port with the same data. */
  async restart(): Promise<void> {
    if (!this.process) throw new Error("a server that the tests did not start cannot be restarted");
    await ended(this.process, "SIGKILL");
    this.process = (await serve(this.dataDir, this.address)).child;
  }

  /** Stops the server and deletes its data. */
  async stop(): Promise<void> {
    if (!this.process) return;
    await ended(this.process, "SIGKILL");
    rmSync(this.dataDir, { recursive: true, force: true });
  }
}

/** The server of a test file. */
export let server: Server;
/** The browser of a test file. */
export let browser: Browser;

/** What people have open since the test began: their pages would go on taking time from the tests that follow. */
const opened: BrowserContext[] = [];

/** Sets up a server and a browser for a test file. Call it at the top level. */
export function useStage(): void {
  beforeAll(async () => {
    server = await Server.start();
    browser = await startBrowser();
  });
  // Those of `beforeAll` are for all tests.
  beforeEach(() => {
    opened.length = 0;
  });
  afterEach(() => Promise.all(opened.map((context) => context.close())));
  afterAll(async () => {
    await browser?.close();
    await server?.stop();
  });
}

/** A browser; each person has a context of their own. */
export async function startBrowser(): Promise<Browser> {
  return chromium.launch({ executablePath: CHROMIUM, args: FLAGS });
}

/**
 * A person's page, in English by default. Page errors and console errors are collected in `faults`;
 * not connections that a given server or its proxy ended, which the page opens again.
 */
export async function person(
  browser: Browser,
  options: BrowserContextOptions = {},
): Promise<{ page: Page; faults: string[] }> {
  const context = await browser.newContext({
    locale: "en-GB",
    viewport: { width: 1280, height: 800 },
    // Drawn without a graphics processor, every frame of an animation takes time from all tests.
    reducedMotion: "reduce",
    ...options,
  });
  opened.push(context);
  context.setDefaultTimeout(PATIENCE_MS);
  const page = await context.newPage();
  if (SLOWDOWN > 1) {
    const devtools = await context.newCDPSession(page);
    await devtools.send("Emulation.setCPUThrottlingRate", { rate: SLOWDOWN });
  }
  const faults: string[] = [];
  page.on("pageerror", (error) => faults.push(error.message));
  page.on("console", (message) => {
    if (message.type() !== "error" || (GIVEN && message.text().includes("net::ERR_"))) return;
    faults.push(`${message.text()} (${message.location().url})`);
  });
  return { page, faults };
}

/** Waits until a condition holds. */
export async function until(holds: () => boolean | Promise<boolean>, timeout = PATIENCE_MS): Promise<void> {
  await vi.waitUntil(holds, { timeout });
}

function dataFolder(): string {
  return mkdtempSync(join(tmpdir(), "chefshat-web-"));
}

function program(): string {
  const named = process.env.CHEFSHAT_BIN;
  if (!named)
    throw new Error("CHEFSHAT_BIN must name the server: cargo build, then CHEFSHAT_BIN=…/target/debug/chefshat");
  return named;
}

function createToken(dataDir: string, role: string): string {
  return execFileSync(program(), ["token", "create", "--role", role, "--data-dir", dataDir], {
    encoding: "utf8",
    stdio: ["ignore", "pipe", "ignore"],
  }).trim();
}

async function serve(dataDir: string, listen: string): Promise<{ child: ChildProcess; address: string }> {
  const args = ["serve", "--listen", listen, "--data-dir", dataDir, "--json", "--until-stdin-closes"];
  const child = spawn(program(), args, { stdio: ["pipe", "pipe", "ignore"] });
  for await (const line of createInterface({ input: child.stdout })) {
    const said: unknown = JSON.parse(line);
    if (typeof said === "object" && said !== null && "address" in said) return { child, address: String(said.address) };
  }
  throw new Error("the server ended before it said where it listens");
}

async function ended(child: ChildProcess, signal: NodeJS.Signals): Promise<void> {
  if (child.exitCode !== null || child.signalCode !== null) return;
  const gone = new Promise((resolve) => child.once("exit", resolve));
  child.kill(signal);
  await gone;
}

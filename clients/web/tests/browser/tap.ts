// A proxy between a browser and the server that records every response, uncompressed, and parses its
// messages. It can fall silent, as a network does that is gone.

import { createServer, type Server as HttpServer, type IncomingMessage, request } from "node:http";
import type { AddressInfo } from "node:net";
import type { DescMessage, MessageShape } from "@bufbuild/protobuf";
import { fromBinary } from "@bufbuild/protobuf";
import type { Server } from "./stage";

/**
 * A gRPC-web frame starts with a byte of flags, of which this one marks trailers, and four bytes of
 * length.
 */
const TRAILERS = 0x80;
const HEAD_BYTES = 5;

/** The response to a request. */
interface Answer {
  readonly path: string;
  /** Names and values of its headers. */
  head: readonly string[];
  readonly parts: Buffer[];
}

/** The proxy. */
export class Tap {
  /** All responses so far, including unfinished ones. */
  readonly answers: Answer[] = [];

  private silent = false;
  /** Responses that are under way. */
  private readonly running = new Set<IncomingMessage>();

  private constructor(private readonly http: HttpServer) {}

  /** Starts listening on a free port. */
  static async before(server: Server): Promise<Tap> {
    const [host, port] = server.address.split(":");
    const http = createServer((asked, answered) => {
      if (tap.silent) return;
      const { method, url: path = "" } = asked;
      const headers = { ...asked.headers, "accept-encoding": "identity" };
      const answer: Answer = { path, head: [], parts: [] };
      tap.answers.push(answer);
      const on = request({ host, port, method, path, headers }, (answering) => {
        answer.head = answering.rawHeaders;
        answered.writeHead(answering.statusCode ?? 502, answering.headers);
        answering.on("data", (part: Buffer) => {
          answer.parts.push(part);
        });
        tap.running.add(answering);
        answering.on("close", () => tap.running.delete(answering));
        answering.pipe(answered);
      });
      on.on("error", () => answered.destroy());
      answered.on("close", () => on.destroy());
      asked.pipe(on);
    });
    const tap = new Tap(http);
    await new Promise<void>((resolve) => http.listen(0, "127.0.0.1", resolve));
    return tap;
  }

  /** Address of the page behind the proxy. */
  get url(): string {
    return `http://127.0.0.1:${(this.http.address() as AddressInfo).port}`;
  }

  /** The methods that were called. */
  get called(): Set<string> {
    return new Set(this.answers.map(({ path }) => path).filter((path) => path.startsWith("/chefshat.v1.")));
  }

  /** The complete messages of all responses of a method, in order. */
  messages<Desc extends DescMessage>(method: string, schema: Desc): MessageShape<Desc>[] {
    return this.answers
      .filter(({ path }) => path === method)
      .flatMap(({ parts }) => framesOf(Buffer.concat(parts)))
      .map((frame) => fromBinary(schema, frame));
  }

  /** The requests whose responses so far have a text, in the head or in the body. */
  having(text: string): string[] {
    const found = this.answers.filter(
      ({ head, parts }) => head.join().includes(text) || Buffer.concat(parts).includes(text),
    );
    return found.map(({ path }) => path);
  }

  /** Passes nothing on any more, in either direction, and closes nothing. */
  fallSilent(): void {
    this.silent = true;
    for (const answering of this.running) answering.unpipe();
  }

  /** Passes on what comes over new connections; the former ones are gone. */
  recover(): void {
    this.silent = false;
    this.http.closeAllConnections();
  }

  async stop(): Promise<void> {
    this.http.closeAllConnections();
    await new Promise((resolve) => this.http.close(resolve));
  }
}

function framesOf(body: Buffer): Buffer[] {
  const frames: Buffer[] = [];
  for (let at = 0; at + HEAD_BYTES <= body.length; ) {
    const flags = body.readUInt8(at);
    const end = at + HEAD_BYTES + body.readUInt32BE(at + 1);
    if (end > body.length) break;
    if ((flags & TRAILERS) === 0) frames.push(body.subarray(at + HEAD_BYTES, end));
    at = end;
  }
  return frames;
}

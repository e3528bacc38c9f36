// What a page about a recorded game asks the server for: the record, and what its decisions were
// worth.

import { useEffect, useState } from "preact/hooks";
import { askUntilAnswered } from "../api/asking";
import { recordApi } from "../api/client";
import { inWords, wordsOf } from "../api/faults";
import type { RecordLine } from "../gen/chefshat/v1/record_pb";
import { type Choice, type EstimatedChoice, estimatedChoices } from "./choices";
import { type Film, filmOf } from "./frames";

/** Reads a record, also after the server was away; the film is undefined until all of it is there. */
export function useFilm(gameId: string) {
  const [film, setFilm] = useState<Film | undefined>(undefined);
  const [fault, setFault] = useState("");
  useEffect(() => {
    const leaving = new AbortController();
    const isWanted = () => !leaving.signal.aborted;
    const read = async () => {
      const lines: RecordLine[] = [];
      for await (const part of recordApi.getRecord({ gameId }, { signal: leaving.signal })) lines.push(...part.lines);
      return lines;
    };
    const load = async () => {
      const lines = await askUntilAnswered(read, isWanted, (found) => isWanted() && setFault(wordsOf(found)));
      if (!lines || !isWanted()) return;
      setFault("");
      setFilm(() => filmOf(lines));
    };
    void load();
    return () => leaving.abort();
  }, [gameId]);
  return { film, fault };
}

/** The estimates of the choices asked for so far, and a way to ask again for what failed. */
export interface Estimates {
  readonly estimated: readonly EstimatedChoice[];
  /** Choices that have been looked at, with those that cannot be estimated. */
  readonly looked: number;
  /** Why no more come, in words; empty while they do. */
  readonly fault: string;
  readonly resume: () => void;
}

/** Has choices estimated in turn; those asked for again resume where they were interrupted. */
export function useEstimatedChoices(gameId: string, asked: readonly Choice[]): Estimates {
  const [answers, setAnswers] = useState<readonly (EstimatedChoice | undefined)[]>([]);
  const [fault, setFault] = useState("");
  const [attempt, setAttempt] = useState(1);
  useEffect(() => {
    const leaving = new AbortController();
    const load = async () => {
      try {
        const left = asked.slice(answers.length);
        for await (const answer of estimatedChoices(gameId, left, leaving.signal)) {
          setAnswers((before) => [...before, answer]);
        }
      } catch (thrown) {
        if (!leaving.signal.aborted) setFault(inWords(thrown));
      }
    };
    setFault("");
    void load();
    return () => leaving.abort();
  }, [gameId, asked, attempt]);
  return {
    estimated: answers.filter((answer) => answer !== undefined),
    looked: answers.length,
    fault,
    resume: () => setAttempt(attempt + 1),
  };
}

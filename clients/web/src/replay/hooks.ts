// What a page about a recorded game asks the server for: the record, and what its decisions were
// worth.

import { useEffect, useState } from "preact/hooks";
import { recordApi } from "../api/client";
import { inWords } from "../api/faults";
import type { RecordLine } from "../gen/chefshat/v1/record_pb";
import { type Film, filmOf } from "./frames";
import { type Choice, type Judgement, judgedChoices } from "./judging";

/** Reads a record; the film is undefined until all of it is there. */
export function useFilm(gameId: string) {
  const [film, setFilm] = useState<Film | undefined>(undefined);
  const [fault, setFault] = useState("");
  useEffect(() => {
    const leaving = new AbortController();
    const load = async () => {
      const lines: RecordLine[] = [];
      try {
        for await (const part of recordApi.getRecord({ gameId }, { signal: leaving.signal })) lines.push(...part.lines);
        setFilm(filmOf(lines));
      } catch (thrown) {
        if (!leaving.signal.aborted) setFault(inWords(thrown));
      }
    };
    void load();
    return () => leaving.abort();
  }, [gameId]);
  return { film, fault };
}

/** Judges what is asked in turn, going on where it was interrupted. */
export function useJudgements(gameId: string, asked: readonly Choice[]) {
  const [answers, setAnswers] = useState<readonly (Judgement | undefined)[]>([]);
  const [fault, setFault] = useState("");
  useEffect(() => {
    const leaving = new AbortController();
    const judge = async () => {
      try {
        const left = asked.slice(answers.length);
        for await (const answer of judgedChoices(gameId, left, leaving.signal)) {
          setAnswers((before) => [...before, answer]);
        }
      } catch (thrown) {
        if (!leaving.signal.aborted) setFault(inWords(thrown));
      }
    };
    setFault("");
    void judge();
    return () => leaving.abort();
  }, [gameId, asked]);
  return { judgements: answers.filter((answer) => answer !== undefined), looked: answers.length, fault };
}

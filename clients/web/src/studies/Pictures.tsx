// Pictures in texts of a study: the files are the study's, and are asked for by the names in the texts.

import { base64Encode } from "@bufbuild/protobuf/wire";
import { type ComponentChildren, createContext, type JSX } from "preact";
import { useContext, useEffect, useMemo, useState } from "preact/hooks";
import { askUntilAnswered } from "../api/asking";
import css from "./Formatted.module.css";
import { formatOf } from "./picture-files";

/** The address of a picture, or empty if the text has none of this name. */
type FindPicture = (name: string, signal: AbortSignal) => Promise<string>;

const Found = createContext<FindPicture>(async () => "");

/** Texts inside show the pictures whose files `load` returns. */
export function WithPictures(props: { load: (name: string) => Promise<Uint8Array>; children: ComponentChildren }) {
  const { load, children } = props;
  const find = useMemo(() => finding(load), [load]);
  return <Found.Provider value={find}>{children}</Found.Provider>;
}

/** Asks for each picture once, and again while the server is away or too busy. */
function finding(load: (name: string) => Promise<Uint8Array>): FindPicture {
  const addresses = new Map<string, Promise<string>>();
  const asked = async (name: string) => {
    const file = await load(name);
    const format = formatOf(file);
    return format ? `data:${format};base64,${base64Encode(file)}` : "";
  };
  const addressOf = (name: string) => {
    const asking = addresses.get(name) ?? asked(name);
    addresses.set(name, asking);
    return asking.catch((thrown) => {
      if (addresses.get(name) === asking) addresses.delete(name);
      throw thrown;
    });
  };
  return async (name, signal) =>
    (await askUntilAnswered(
      () => addressOf(name),
      () => !signal.aborted,
    )) ?? "";
}

/** A picture of the study, or its words as long as it is not there. */
export function Picture({ name, words }: { name: string; words: string }): JSX.Element | string {
  const find = useContext(Found);
  const [address, setAddress] = useState("");
  useEffect(() => {
    const gone = new AbortController();
    void find(name, gone.signal).then((found) => {
      if (!gone.signal.aborted) setAddress(found);
    });
    return () => gone.abort();
  }, [find, name]);
  return address === "" ? words : <img class={css.picture} src={address} alt={words} />;
}

// Pictures in texts of a study: the files are the study's, and are asked for by the names in the texts.

import { base64Encode } from "@bufbuild/protobuf/wire";
import { type ComponentChildren, createContext, type JSX } from "preact";
import { useContext, useEffect, useMemo, useState } from "preact/hooks";
import css from "./Formatted.module.css";
import { formatOf } from "./picture-files";

/** The address of a picture, or empty if there is none of this name. */
type FindPicture = (name: string) => Promise<string>;

const Found = createContext<FindPicture>(async () => "");

/** Texts inside show the pictures whose files `load` returns. */
export function WithPictures(props: { load: (name: string) => Promise<Uint8Array>; children: ComponentChildren }) {
  const { load, children } = props;
  const find = useMemo(() => finding(load), [load]);
  return <Found.Provider value={find}>{children}</Found.Provider>;
}

/** Asks for each picture once. */
function finding(load: (name: string) => Promise<Uint8Array>): FindPicture {
  const addresses = new Map<string, Promise<string>>();
  const address = async (name: string) => {
    try {
      const file = await load(name);
      const format = formatOf(file);
      return format ? `data:${format};base64,${base64Encode(file)}` : "";
    } catch {
      // The words stand for it, until it is asked for again.
      addresses.delete(name);
      return "";
    }
  };
  return (name) => {
    const known = addresses.get(name) ?? address(name);
    addresses.set(name, known);
    return known;
  };
}

/** A picture of the study, or its words as long as it is not there. */
export function Picture({ name, words }: { name: string; words: string }): JSX.Element | string {
  const find = useContext(Found);
  const [address, setAddress] = useState("");
  useEffect(() => {
    let gone = false;
    void find(name).then((found) => {
      if (!gone) setAddress(found);
    });
    return () => {
      gone = true;
    };
  }, [find, name]);
  return address === "" ? words : <img class={css.picture} src={address} alt={words} />;
}

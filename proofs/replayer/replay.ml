(* Replays a contract log of tautline: replay FILE

   Reads the lines of a log and takes each one to the functions that Coq extracts from replay.v (model.ml). This file
   is not proved: it reads numbers, calls [Model.rows_at_start] once and [Model.step] for each line in order, compares
   the counts of the last line, and prints the result. proofs/README.md lists the lines.

   Exit codes: 0 confirmed, 1 denied, 2 unreadable or malformed. *)

(* The problem of a line that cannot be read, and a line that denies the log. *)
exception Malformed of string
exception Denied of string

let malformed form = Printf.ksprintf (fun text -> raise (Malformed text)) form

(* Numbers *)

(* Every finite double is a multiple of 2^-1074. *)
let one = Z.shift_left Z.one 1074

let is_digit c = c >= '0' && c <= '9'
let is_hexadecimal c = is_digit c || (c >= 'a' && c <= 'f')
let for_all f text = List.for_all f (List.of_seq (String.to_seq text))

(* A number of at most 20 decimal digits without leading zeros. *)
let count text =
  let length = String.length text in
  if length = 0 || length > 20 || not (for_all is_digit text) || (length > 1 && text.[0] = '0') then
    malformed "\"%s\" is not a whole number" (String.escaped text);
  Z.of_string text

let sixteen text =
  if String.length text <> 16 || not (for_all is_hexadecimal text) then
    malformed "\"%s\" is not 16 lower-case hexadecimal digits" (String.escaped text);
  Z.of_string ("0x" ^ text)

(* A double by its bits: sign, 11 bits of exponent, 52 bits of fraction. Returns the double times 2^1074. *)
let double text =
  let bits = sixteen text in
  let fraction = Z.extract bits 0 52 and exponent = Z.to_int (Z.extract bits 52 11) in
  if exponent = 2047 then malformed "%s is not a finite number" text;
  let size =
    if exponent = 0 then fraction
    else Z.shift_left (Z.add fraction (Z.shift_left Z.one 52)) (exponent - 1) in
  if Z.testbit bits 63 then Z.neg size else size

let answer = function
  | "yes" -> true
  | "no" -> false
  | text -> malformed "\"%s\" is neither yes nor no" (String.escaped text)

(* Lines *)

let point x y z = { Model.p_x = double x; p_y = double y; p_z = double z }

let segment = function
  | [a; b; c; d; e; f] -> { Model.s_begin = point a b c; s_stop = point d e f }
  | _ -> malformed "a segment has six numbers"

let divider = function
  | [x; y; z; offset] -> { Model.d_x = double x; d_y = double y; d_z = double z; d_offset = double offset }
  | _ -> malformed "a plane has four numbers"

let content ~is_owner = function
  | ["none"] when is_owner -> Model.OfOwner None
  | number :: plane when is_owner ->
      Model.OfOwner (Some { Model.p_number = count number; p_divider = divider plane })
  | [a; b; c; d; e; f; "none"] -> Model.OfFollower (segment [a; b; c; d; e; f], None)
  | [a; b; c; d; e; f; number; accepted] ->
      let decision = { Model.d_number = count number; d_accepted = answer accepted } in
      Model.OfFollower (segment [a; b; c; d; e; f], Some decision)
  | _ -> malformed "a message has \"none\" or a number and its plane or decision; a follower's begins with its segment"

let entry = function
  | ["instant"; v; period] -> Model.Instant (count v, count period)
  | ["take"; a; b; number; accepted] -> Model.Take (count a, count b, count number, answer accepted)
  | "propose" :: a :: b :: number :: plane -> Model.Propose (count a, count b, count number, divider plane)
  | ["decide"; b; a; number; accepted] -> Model.Decide (count b, count a, count number, answer accepted)
  | "reserve" :: v :: numbers -> Model.Reserve (count v, segment numbers)
  | "send" :: a :: b :: stamp :: hash :: rest ->
      let from = count a and dest = count b in
      Model.Send (from, dest, count stamp, sixteen hash, content ~is_owner:(Z.lt from dest) rest)
  | "hear" :: b :: a :: stamp :: hash :: rest ->
      let dest = count b and from = count a in
      Model.Hear (dest, from, count stamp, sixteen hash, content ~is_owner:(Z.lt from dest) rest)
  | ["hold"; a; b; x; y; z; c] -> Model.Hold (count a, count b, [divider [x; y; z; c]])
  | ["hold"; a; b; x; y; z; c; x'; y'; z'; c'] ->
      Model.Hold (count a, count b, [divider [x; y; z; c]; divider [x'; y'; z'; c']])
  | ["moved"; v] ->
      raise (Denied (Printf.sprintf "vehicle %s did not fly the segment that it had reserved" (Z.to_string (count v))))
  | ["foreign"; a; b] ->
      let a = Z.to_string (count a) and b = Z.to_string (count b) in
      raise (Denied (Printf.sprintf "vehicle %s holds a plane towards %s that no event gave it" a b))
  | word :: _ -> malformed "\"%s\" begins no line of a log, or the line has another number of words" (String.escaped word)
  | [] -> malformed "the line is empty"

let reason = function
  | Model.UnknownVehicle -> "there is no such vehicle or pair"
  | Model.AfterEnd -> "an event follows the planes at the end"
  | Model.WrongPeriod -> "the number of the period is not the next one"
  | Model.NotAtInstant -> "the vehicle is not at an instant"
  | Model.NotReserved -> "the vehicle has reserved no segment at its last instant"
  | Model.NothingPending -> "no proposal is pending"
  | Model.NotHeard -> "the owner has not heard the decision on its pending proposal"
  | Model.OtherDecision -> "the owner heard the other decision"
  | Model.StillPending -> "the owner proposes before it took the decision on its pending proposal"
  | Model.PlaneOutside -> "the plane does not contain the segment of the vehicle"
  | Model.WrongNumber -> "the number of the proposal is not the model's"
  | Model.NoProposal -> "the follower has heard no proposal with this number"
  | Model.DecidedBefore -> "the follower decided on this number before"
  | Model.ContractIsVoid -> "the contract is void"
  | Model.SegmentOutside -> "a plane that the vehicle holds does not contain the segment"
  | Model.SentBefore -> "the vehicle has sent a message to this one since its last instant"
  | Model.WrongStamp -> "the stamp is not the sender's period"
  | Model.WrongHash -> "the hash is not that of the starts"
  | Model.WrongContent -> "the content is not that of the sender's contract"
  | Model.NeverSent -> "no such message was sent"
  | Model.OtherPlanes -> "the planes are not those that the vehicle holds"

(* Files *)

type totals = { events : int; instants : int; sent : int; heard : int }

type log = { channel : in_channel; size : int; mutable number : int; mutable check : int; mutable before : int }

(* CRC-32 of IEEE 802.3, bit by bit for each byte value. *)
let table =
  let step c = if c land 1 = 1 then 0xEDB88320 lxor (c lsr 1) else c lsr 1 in
  Array.init 256 (fun byte -> List.fold_left (fun c _ -> step c) byte [1; 2; 3; 4; 5; 6; 7; 8])

let add check byte = table.((check lxor Char.code byte) land 255) lxor (check lsr 8)
let checked state = Printf.sprintf "%08x" (state lxor 0xFFFFFFFF)

(* The words of the next line. A line without an end of line is a part of one. *)
let next log =
  match input_line log.channel with
  | exception End_of_file -> malformed "the log ends before its line \"end\": it is not complete"
  | line ->
      log.number <- log.number + 1;
      log.before <- log.check;
      log.check <- add (String.fold_left add log.check line) '\n';
      if pos_in log.channel = log.size && (seek_in log.channel (log.size - 1); input_char log.channel <> '\n') then
        malformed "the line has no end: the log is not complete";
      String.split_on_char ' ' line

let rec starts log found =
  match next log with
  | "start" :: v :: margin :: delta :: numbers ->
      let number = List.length found in
      if not (Z.equal (count v) (Z.of_int number)) then malformed "the start of vehicle %d is missing" number;
      let start = { Model.s_segment = segment numbers; s_margin = double margin } in
      starts log ((start, double delta) :: found)
  | words -> (List.rev found, words)

(* The first planes of all pairs, and the next line. *)
let pairs log words vehicles =
  let rec row i j words found =
    if i >= vehicles then (List.rev found, words)
    else if j >= vehicles then row (i + 1) (i + 2) words found
    else
      match words with
      | "pair" :: a :: b :: hash :: plane when Z.equal (count a) (Z.of_int i) && Z.equal (count b) (Z.of_int j) ->
          let plane = (sixteen hash, divider plane) in
          row i (j + 1) (next log) (plane :: found)
      | _ -> malformed "the first plane of vehicles %d and %d is missing" i j in
  row 0 1 words []

(* The largest decimal number of six digits not above a length, in metres. *)
let metres length =
  let million = Z.of_int 1_000_000 in
  let whole, rest = Z.ediv_rem (Z.fdiv (Z.mul length million) one) million in
  Printf.sprintf "%s.%06d" (Z.to_string whole) (Z.to_int rest)

let rec replay log vertical rows totals words =
  let totals = { totals with events = totals.events + 1 } in
  match words with
  | ["end"; events; instants; sent; heard; check] ->
      let counted = [totals.events - 1; totals.instants; totals.sent; totals.heard] in
      let stated = List.map count [events; instants; sent; heard] in
      if not (List.for_all2 (fun a b -> Z.equal (Z.of_int a) b) counted stated) then
        raise (Denied "the log has other numbers of events, instants and messages than its last line states");
      if not (Model.is_complete rows) then raise (Denied "the planes at the end of a vehicle are missing");
      if pos_in log.channel <> log.size then malformed "bytes follow the line \"end\"";
      if totals.instants = 0 then malformed "the log has no instant, so nothing was flown";
      if checked log.before <> check then malformed "a line was altered: the CRC-32 of the log differs";
      (rows, { totals with events = totals.events - 1 })
  | _ ->
      let entry = entry words in
      let rows = match Model.step one vertical entry rows with
        | Model.Accepted rows -> rows
        | Model.Forbidden why -> raise (Denied (reason why)) in
      let totals = match entry with
        | Model.Instant _ -> { totals with instants = totals.instants + 1 }
        | Model.Send _ -> { totals with sent = totals.sent + 1 }
        | Model.Hear _ -> { totals with heard = totals.heard + 1 }
        | _ -> totals in
      replay log vertical rows totals (next log)

let check log =
  if next log <> ["tautline"; "contract"; "log"; "1"] then
    malformed "the file does not begin with \"tautline contract log 1\"";
  let vertical = match next log with
    | ["vertical"; number] -> double number
    | _ -> malformed "the factor of vertical lengths is missing" in
  if Z.sign vertical <= 0 then malformed "the factor of vertical lengths must be above 0";
  let found, words = starts log [] in
  let vehicles = List.length found in
  if vehicles < 2 then malformed "the log has fewer than two vehicles, so it has no pair to confirm";
  let delta = snd (List.hd found) in
  if List.exists (fun (_, other) -> not (Z.equal other delta)) found then
    malformed "the vehicles have different safety distances";
  let all = List.map fst found in
  let rests = List.map (fun start -> Z.sub start.Model.s_margin (Model.slack one)) all in
  (* Twice the least distance of a vehicle from its reference that the margins allow. *)
  let tube = List.fold_left Z.min (List.hd rests) rests in
  if Z.sign delta <= 0 || Z.lt (Z.mul (Z.of_int 2) tube) delta then
    raise (Denied "a margin is less than half of the safety distance and its part for rounding");
  let planes, words = pairs log words vehicles in
  let rows = match Model.rows_at_start one vertical Z.zero all planes with
    | Some rows -> rows
    | None -> raise (Denied "the first plane of a pair does not contain the segments of both starts") in
  let rows, totals = replay log vertical rows { events = 0; instants = 0; sent = 0; heard = 0 } words in
  let pairs = List.length (Model.pairs_of rows) in
  let scaled = if Z.equal vertical one then "" else ", in scaled lengths" in
  Printf.printf "CONFIRMED: vehicles within %s m of their references are at least %s m apart%s\n"
    (metres (Z.fdiv (Z.sub (Z.mul (Z.of_int 2) tube) delta) (Z.of_int 2))) (metres delta) scaled;
  Printf.printf "examined   %d vehicles, %d pairs, %d instants, %d events; %d messages sent, %d received\n"
    vehicles pairs totals.instants totals.events totals.sent totals.heard

let unreadable problem =
  Printf.eprintf "replay: cannot read %s; give a file that `tautline run --contract-log FILE` wrote\n" problem;
  exit 2

let () =
  match Sys.argv with
  | [| _; path |] -> (
      match open_in_bin path with
      | exception Sys_error problem -> unreadable problem
      | channel -> (
          match in_channel_length channel with
          | exception Sys_error problem -> unreadable problem
          | size -> (
              let log = { channel; size; number = 0; check = 0xFFFFFFFF; before = 0xFFFFFFFF } in
              match check log with
              | () -> ()
              | exception Denied why -> Printf.printf "DENIED: %s, line %d: %s\n" path log.number why; exit 1
              | exception Malformed why -> Printf.printf "%s, line %d: %s\n" path log.number why; exit 2
              | exception Sys_error problem -> unreadable problem)))
  | _ -> prerr_endline "usage: replay FILE, a log of `tautline run --contract-log FILE`"; exit 2

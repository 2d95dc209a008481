//! Page of a live watch, drawn by the script of replays.

use maud::{DOCTYPE, PreEscaped, html};

use super::{POLICY, metadata, replay, style, theme_choice};
use crate::replay::Replay;

/// Rules of the band with the state, and of the lists.
const LIVE_STYLE: &str = include_str!("live.css");

/// Returns the page of a live watch. It reads positions and notices from the WebSocket `live` of its server.
#[must_use]
pub fn live_page() -> String {
    let (script, hash) = replay::packed(embedded!("TAUTLINE_ASSETS", "live.js"));
    let policy = format!("{POLICY}; {} {hash}; connect-src 'self'", replay::script_source());
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                (metadata(&policy))
                title { "Live watch" }
                style { (PreEscaped(style())) (PreEscaped(replay::STYLE)) (PreEscaped(LIVE_STYLE)) }
            }
            body {
                header {
                    (theme_choice())
                    p.kind { "Live watch" }
                    h1 { "tautline watch" }
                    div.band #band data-level="undecided" {
                        span.band-icon #icon aria-hidden="true" { "?" }
                        div.band-text {
                            p #word role="alert" { "UNDECIDED" }
                            p #brake {}
                            p #verdict { "the page is not connected" }
                        }
                        button type="button" #sound aria-pressed="false" { "Sound: off" }
                    }
                }
                main {
                    section {
                        h2 { "Positions" }
                        p.about { "The newest positions, with trails of the last 20 s." }
                        p #absent { "No vehicle is heard." }
                        div.replay data-label="the watch" data-start="later" {
                            script type="application/json" { (PreEscaped(Replay::empty_json())) }
                        }
                    }
                    section {
                        h2 { "Closest pairs" }
                        p.about {
                            "Expected: by constant velocity since the newest message. At least: the smallest \
                             separation that the bounds below allow."
                        }
                        div.scroll {
                            table {
                                thead {
                                    tr {
                                        th scope="col" { "pair" }
                                        th.number scope="col" { "expected [m]" }
                                        th.number scope="col" { "at least [m]" }
                                    }
                                }
                                tbody #pairs {}
                            }
                        }
                        ul #facts {}
                    }
                    section { h2 { "Notices" } ul #log {} }
                }
                (replay::script())
                script { (PreEscaped(script)) }
            }
        }
    };
    page.into_string()
}

#[cfg(test)]
mod tests {
    use super::live_page;

    #[test]
    fn the_page_admits_its_two_scripts_and_its_own_server_only() {
        let page = live_page();
        assert_eq!(page.matches("'sha256-").count() + page.matches("&#39;sha256-").count(), 2);
        assert!(page.contains("connect-src 'self'") || page.contains("connect-src &#39;self&#39;"));
        assert!(!page.contains("http://") && !page.contains("https://"));
    }

    #[test]
    fn the_last_moment_to_brake_stands_above_the_long_sentence() {
        let page = live_page();
        let place = |id: &str| page.find(&format!("id=\"{id}\"")).expect("an element");
        assert!(place("word") < place("brake") && place("brake") < place("verdict"));
    }
}

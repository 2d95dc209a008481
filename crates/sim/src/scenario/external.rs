//! Laws from outside the scenario.

use std::fmt;
use std::sync::Arc;

use super::Scenario;
use tautline_laws::law::{Law, ParameterError};

/// Law from outside the scenario, such as a law in Python, that flies in place of the scenario's own law.
///
/// A certificate and rates are those that the law itself returns.
#[derive(Clone)]
pub struct ExternalLaw {
    name: String,
    requires_calling_thread: bool,
    source_sha256: Option<String>,
    make: Arc<dyn Fn() -> Box<dyn Law> + Send + Sync>,
}

impl ExternalLaw {
    /// Returns an external law whose flights get clones of `law`.
    #[must_use]
    pub fn new(law: impl Law + Clone + Sync + 'static) -> Self {
        let (name, requires_calling_thread) = (law.name().to_owned(), law.capabilities().requires_calling_thread);
        Self { name, requires_calling_thread, source_sha256: None, make: Arc::new(move || Box::new(law.clone())) }
    }

    /// Returns the same law, but `make` makes the law of each flight, from a source with this SHA-256. Other processes
    /// that load the law by its name compare it.
    #[must_use]
    pub fn from_source(self, sha256: String, make: impl Fn() -> Box<dyn Law> + Send + Sync + 'static) -> Self {
        Self { source_sha256: Some(sha256), make: Arc::new(make), ..self }
    }

    /// Returns the SHA-256 of the source from which every process makes the law.
    #[must_use]
    pub fn source_sha256(&self) -> Option<&str> {
        self.source_sha256.as_deref()
    }

    /// Returns the name of the law.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns whether the law must run on the calling thread; studies then fly on that thread alone.
    #[must_use]
    pub fn requires_calling_thread(&self) -> bool {
        self.requires_calling_thread
    }

    /// Returns the law for one flight.
    #[must_use]
    pub fn law(&self) -> Box<dyn Law> {
        (self.make)()
    }
}

impl fmt::Debug for ExternalLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("ExternalLaw").field(&self.name).finish()
    }
}

impl PartialEq for ExternalLaw {
    /// Clones of one external law are equal.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.make, &other.make)
    }
}

impl Scenario {
    /// Returns the law that flies: the external law, or else the scenario's own ([`Scenario::law`]).
    ///
    /// # Errors
    /// As [`Scenario::law`].
    pub fn flown_law(&self) -> Result<Box<dyn Law>, ParameterError> {
        self.external_law.as_ref().map_or_else(|| self.law(), |external| Ok(external.law()))
    }

    /// Returns whether flights of the scenario must stay on the calling thread.
    #[must_use]
    pub fn requires_calling_thread(&self) -> bool {
        self.external_law.as_ref().is_some_and(ExternalLaw::requires_calling_thread)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preflight::Preflight;
    use crate::scenario::Source;
    use crate::sim::{Simulation, fly};
    use std::ops::ControlFlow;
    use tautline_core::swarm::Rows;
    use tautline_laws::law::LawError;
    use tautline_laws::observation::Observation;

    /// Law without commands.
    #[derive(Clone)]
    struct Coasting;

    impl Law for Coasting {
        fn name(&self) -> &'static str {
            "coasting"
        }

        fn command(&mut self, _at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
            command.fill(0.0);
            Ok(())
        }
    }

    #[test]
    fn an_external_law_flies_without_the_certificate_of_the_own_law() {
        let mut scenario =
            Scenario::read(&Source::resolve("pentagon").expect("built in"), &[]).expect("a valid scenario");
        let own = Preflight::of(&scenario).expect("a law");
        assert!(own.certified_m.is_some());
        let at_rest = |scenario: &Scenario| {
            let mut simulation = Simulation::new(scenario).expect("a simulation");
            (0..240).for_each(|_| simulation.step());
            simulation.state().positions_m == scenario.start.positions_m
        };
        assert!(!at_rest(&scenario));
        scenario.external_law = Some(ExternalLaw::new(Coasting));
        assert!(at_rest(&scenario));
        let found = Preflight::of(&scenario).expect("a law");
        assert_eq!((found.certified_m, found.start_peak_m_s2), (None, None));
        let parts = crate::sim::Components::of(&scenario).expect("a law");
        let flight = fly(&scenario, parts, &mut (), &mut |_| ControlFlow::Break(())).expect("a flight");
        assert_eq!((flight.law.as_str(), flight.certificate.certified_m), ("coasting", None));
    }

    #[test]
    fn only_clones_are_equal() {
        let one = ExternalLaw::new(Coasting);
        assert_eq!(one, one.clone());
        assert_ne!(one, ExternalLaw::new(Coasting));
    }
}
